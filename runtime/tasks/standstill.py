"""Whether the car stands: locked wheels report 0 while it slides on."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from wallride.drivers.api import Clock, Motor
from wallride.runtime.arbitration.command import Output
from wallride.runtime.control.perception.sliding_speed import SlidingSpeed

STANDS_BELOW_MPS: Final = 0.05
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

    def _most_mps(self) -> float:
        state = self.motor.state
        return abs(self._speed.update(state.speed_mps if state is not None else None, self.clock()))
