"""Policy without a wall: fade the steering and drive slowly, search for a wall, or stop."""

from typing import Literal

from wallride.drivers.api import Drive

FADE_PER_SCAN = 0.05
SEARCH_PER_M = 0.55
"""Curvature of the search circle [1/m]: a full turn is 11.4 m long, well within the steering's limit."""


class Lost:
    """Drives the car while no wall is found; everything for a wall on the left."""

    def __init__(
        self, manner: Literal["slow", "search", "stop"], speed_mps: float, at_most_m: float, search_rad: float
    ) -> None:
        self._manner = manner
        self._speed_mps = speed_mps
        self._at_most_m = at_most_m
        self._search_rad = search_rad
        self._steering_rad = 0.0
        self._way_m = 0.0

    def tune(self, manner: Literal["slow", "search", "stop"], speed_mps: float, at_most_m: float) -> None:
        """Change the settings; the last steering and the distance since are kept."""
        self._manner = manner
        self._speed_mps = speed_mps
        self._at_most_m = at_most_m

    def found(self, steering_rad: float) -> None:
        """Record the steering along a wall that was found."""
        self._steering_rad = steering_rad
        self._way_m = 0.0

    def drive(self, moved_m: float) -> tuple[Drive | None, str]:
        """Return the drive for one scan without a wall, `moved_m` after the last; None requests a stop."""
        if self._manner == "stop":
            return None, "no wall"
        if self._manner == "slow":
            self._steering_rad *= 1.0 - FADE_PER_SCAN
            return Drive(self._speed_mps, self._steering_rad), "no wall: going on slowly"
        self._way_m += abs(moved_m)
        if self._way_m > self._at_most_m:
            return None, "no wall found: search given up"
        return Drive(self._speed_mps, self._search_rad), "no wall: searching"
