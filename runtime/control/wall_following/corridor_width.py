"""Distance to the wall in narrow corridors: half of the free width, also for a while after it.

Where corridors meet, there is no opposite wall beside the car, but the way on is as narrow as the way there was. A ball
that grew at once to the whole wanted distance would not fit into it: the car would lose its wall in the junction.
"""

import math

from wallride.runtime.control.wall_following.wall_fit import WallLine

WIDENS_PER_M = 0.1
"""Assumed growth of a narrow width per metre driven, until another width is seen."""
CORRIDOR_M = 1.2
"""Minimum length of a corridor; a pole is beside the car for 1 m, and the width beyond it is as before."""
ALONG_RAD = 0.35
"""A line at a greater angle to the car is a corner or the end of a wall; the width beside it says nothing of the way
on, and counts for this scan alone."""


class Room:
    """Tracks the distance that is kept in place of the desired one."""

    def __init__(self) -> None:
        self._known_m = math.inf
        self._narrow_for_m = 0.0

    def within_m(self, desired_m: float) -> float:
        """Return the wanted distance, or less where the way was narrower."""
        return min(desired_m, self._known_m)

    def beside_m(self, line: WallLine | None, room_m: float, desired_m: float, moved_m: float) -> float:
        """Return the distance to keep beside a line of the wall, moved_m after the last scan.

        room_m: what this scan has room for, at most the wanted distance.
        """
        self._known_m += WIDENS_PER_M * abs(moved_m)
        narrow = room_m < desired_m
        self._narrow_for_m = self._narrow_for_m + abs(moved_m) if narrow else 0.0
        kept_m = min(room_m, self._known_m)
        along = line is not None and abs(line.heading_rad) < ALONG_RAD
        if along and (not narrow or self._narrow_for_m > CORRIDOR_M):
            self._known_m = kept_m if kept_m < desired_m else math.inf
        return kept_m
