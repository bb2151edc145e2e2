"""Whether the wheels slow down while the car brakes: a controller, or its driver, may take commands and do nothing."""

import logging
from typing import Final

from wallride.drivers.api import MotorState
from wallride.runtime.arbitration.command import Output

BRAKES_FOR_S: Final = 1.0
"""Time within which braking wheels have become slower by SLOWER_MPS: rolling out alone takes as much from them."""
SLOWER_MPS, MOVES_MPS = 0.2, 0.3

log = logging.getLogger("wallride.health")


class Obedience:
    """Watches braking. words: what to say of wheels that go on, () while there is nothing."""

    def __init__(self) -> None:
        self.words: tuple[str, ...] = ()
        self._since_s: float | None = None
        self._from_mps = 0.0

    def look(self, output: Output | None, state: MotorState | None, now_s: float) -> None:
        """Take in what was commanded and what the wheels do."""
        speed_mps = 0.0 if state is None else abs(state.speed_mps)
        if output is None or output.drive.speed_mps or speed_mps < MOVES_MPS:
            self._since_s, self.words = None, ()
        elif self._since_s is None:
            self._since_s, self._from_mps = now_s, speed_mps
        elif now_s - self._since_s >= BRAKES_FOR_S:
            self._tell(speed_mps if speed_mps > self._from_mps - SLOWER_MPS else 0.0)
            self._since_s, self._from_mps = now_s, speed_mps

    def _tell(self, speed_mps: float) -> None:
        if speed_mps and not self.words:
            log.error("the car brakes and its wheels go on at %.1f m/s", speed_mps)
        goes_on = f"the wheels go on at {speed_mps:.1f} m/s although the car brakes: cut the motor's power"
        self.words = (goes_on,) if speed_mps else ()
