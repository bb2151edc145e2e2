"""Whether the pose turns the other way than the wheels steer: a scene that slides over another place fits and turns."""

from collections import deque
from typing import Final

WAY_M: Final = 4.0
"""Way over which turns are compared: as long as a bend, so that the lag of the turn does not count."""
LEAST_WAY_M: Final = 0.001
"""Way from scan to scan below which a car stands."""
OPPOSITE_RAD: Final = 0.8
"""Least turn of both, the other way round each, that contradicts: drives on floors of 0.5 and 0.8 with a trim of 0.02
rad had 0.43 at most, a car outside of its course 0.88 and more. How far both turn says nothing: a car understeers."""
FITS_SHARE: Final = 0.9
"""Share of beams on a wall from which on a scan is believed against the wheels: a car that spins steers against it."""


class TurnCheck:
    """Compares both turns over the last way."""

    def __init__(self) -> None:
        self._steps: deque[tuple[float, float, float]] = deque()
        self.begin()

    def begin(self) -> None:
        """Forget the way so far."""
        self._steps.clear()
        self._way_m = self._pose_rad = self._wheels_rad = 0.0

    def take(self, way_m: float, pose_rad: float, wheels_rad: float) -> None:
        """Take in the way from scan to scan, and by how much pose and wheels have turned on it."""
        if abs(way_m) < LEAST_WAY_M:
            return
        self._steps.append((abs(way_m), pose_rad, wheels_rad))
        self._add(self._steps[-1], 1.0)
        while self._way_m > WAY_M:
            self._add(self._steps.popleft(), -1.0)

    def contradicts(self, share: float) -> bool:
        """Return whether the turns speak against the pose. share: of the newest scan's beams that fit."""
        if not share < FITS_SHARE or self._pose_rad * self._wheels_rad >= 0.0:
            return False
        return min(abs(self._pose_rad), abs(self._wheels_rad)) > OPPOSITE_RAD

    def _add(self, step: tuple[float, float, float], sign: float) -> None:
        self._way_m += sign * step[0]
        self._pose_rad += sign * step[1]
        self._wheels_rad += sign * step[2]
