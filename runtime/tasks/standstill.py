"""Whether the car stands: locked wheels report 0 while it slides on."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from wallride.drivers.api import Clock, Drive, Motor
from wallride.runtime.arbitration.command import Output
from wallride.runtime.control.perception.sliding_speed import SlidingSpeed

STANDS_BELOW_MPS: Final = 0.05
REST_TIMEOUT_S: Final = 1.0
REST_PERIOD_S: Final = 0.02
ICE_MPS2: Final = 2.0
"""Deceleration of a slide on the most slippery floor: friction 0.2. What the wheels lose faster, the car may still
have."""


@dataclass(slots=True)
class Standstill:
    """Follows the wheels, also while they are locked. output: returns the mux's last decision."""

    motor: Motor
    output: Callable[[], Output | None]
    clock: Clock
    _speed: SlidingSpeed = field(default_factory=lambda: SlidingSpeed(ICE_MPS2, ICE_MPS2))

    def tick(self, _late_s: float, _missed: int) -> None:
        """Follow the wheels once; a `periodic.Tick`."""
        self._most_mps()

    def holds(self) -> bool:
        """Tell whether no source drives and the car stands, however slippery the floor is; not without a report."""
        output = self.output()
        return (
            self._most_mps() < STANDS_BELOW_MPS
            and self.motor.state is not None
            and (output is None or output.drive.speed_mps == 0.0)
        )

    async def reach(self) -> None:
        """Brake until the car stands or REST_TIMEOUT_S is over; the first brake goes out at once.

        Locked wheels on a sliding car read 0, and a motor that is lost meanwhile may come back: neither is a rest.
        """
        motor, give_up_s = self.motor, self.clock() + REST_TIMEOUT_S
        steering_rad = motor.state.steering_rad if motor.state is not None else 0.0
        while self.clock() < give_up_s:
            motor.send(Drive(0.0, steering_rad))
            if self._most_mps() < STANDS_BELOW_MPS:
                return
            await asyncio.sleep(REST_PERIOD_S)

    def _most_mps(self) -> float:
        """Return the most speed that the car may have now, also without a report since a while ago."""
        state = self.motor.state
        return abs(self._speed.update(state.speed_mps if state is not None else None, self.clock()))
