"""What the lab report's law reads from a scan: the fitted line, three distances to the wall, the range ahead.

Ranges up to 0.2 m are dropped; a line by least squares through the side sector's points. All distances are the lidar's.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wallride.drivers.api import Scan
from wallride.runtime.control.perception.geometry import Floats, points_m, sector

NONSENSE_BELOW_M = 0.2
"""Ranges up to this are dropped, as the report has it: dust on the window reads as centimetres."""
SIDE_FROM_RAD = 0.1 * math.pi
SIDE_TO_RAD = 0.6 * math.pi
NEAREST_COUNT = 3
AHEAD_RAD = math.radians(0.5)
"""Half width of "straight ahead": a few beams, because a single one is often without an echo."""
Distance = Literal["three_smallest", "line", "intercept"]


@dataclass(frozen=True, slots=True)
class WallMeasures:
    """One scan's wall. angle_rad: of the line, positive where the car must turn towards the wall.

    ahead_m: inf without an echo. three_smallest_m: mean of the three smallest ranges. line_m: perpendicular to the
    line. intercept_m: along the lidar's left-right axis, inf where the line does not cross it.
    """

    angle_rad: float
    smallest_m: float
    three_smallest_m: float
    line_m: float
    intercept_m: float
    ahead_m: float

    def distance_m(self, which: Distance) -> float:
        """Return one of the three distances."""
        if which == "line":
            return self.line_m
        return self.intercept_m if which == "intercept" else self.three_smallest_m


def measured(scan: Scan, side: Literal["left", "right"], *, by_the_letter: bool = False) -> WallMeasures | None:
    """Return the measures of the wall on a side; None with fewer than three usable ranges in its sector.

    by_the_letter: sector from straight ahead on, as in the report's text, and its second (left) or last (right) beam as
    the range ahead, as in its code.
    """
    sign = 1.0 if side == "left" else -1.0
    from_rad = 0.0 if by_the_letter else SIDE_FROM_RAD
    part = sector(scan, from_rad, SIDE_TO_RAD) if sign > 0 else sector(scan, -SIDE_TO_RAD, -from_rad)
    ranges_m = scan.ranges_m[part]
    x_m, y_m = points_m(scan, part)[:, ranges_m > NONSENSE_BELOW_M]  # NaN compares as not greater
    if x_m.size < NEAREST_COUNT:
        return None
    y_m = sign * y_m
    slope = _slope(x_m, y_m)
    angle_rad = math.atan(slope)
    at_lidar_m = float(y_m.mean()) - slope * float(x_m.mean()) if math.isfinite(slope) else math.inf
    line_m = abs(at_lidar_m) * math.cos(angle_rad) if math.isfinite(slope) else abs(float(x_m.mean()))
    reached_m = np.hypot(x_m, y_m)
    ahead_m = _beam_m(scan, part.start + 1 if sign > 0 else part.stop - 1) if by_the_letter else range_ahead_m(scan)
    return WallMeasures(
        angle_rad, float(reached_m.min()), mean_of_nearest_m(reached_m), line_m, abs(at_lidar_m), ahead_m
    )


def range_ahead_m(scan: Scan) -> float:
    """Return the mean of the three nearest usable ranges straight ahead, infinity when there are none.

    The report has no rule for "no echo": its comparisons then find nothing near. That is one of its weaknesses.
    """
    ranges_m = scan.ranges_m[sector(scan, -AHEAD_RAD, AHEAD_RAD)]
    usable_m = ranges_m[ranges_m > NONSENSE_BELOW_M]
    return mean_of_nearest_m(usable_m.astype(np.float64)) if usable_m.size else math.inf


def middle_beam_m(scan: Scan) -> float:
    """Return the range of the middle beam as it is, infinity without an echo."""
    return _beam_m(scan, scan.ranges_m.size // 2)


def mean_of_nearest_m(ranges_m: Floats) -> float:
    """Return the mean of the three smallest values (of all of them when there are fewer)."""
    count = min(NEAREST_COUNT, ranges_m.size)
    return float(np.partition(ranges_m, count - 1)[:count].mean())


def _beam_m(scan: Scan, number: int) -> float:
    range_m = float(scan.ranges_m[number])
    return range_m if math.isfinite(range_m) else math.inf


def _slope(x_m: Floats, y_m: Floats) -> float:
    """Return dy/dx of the least-squares line; a vertical pile of points has an infinite slope."""
    x_centred, y_centred = x_m - x_m.mean(), y_m - y_m.mean()
    spread = float(x_centred @ x_centred)
    return float(x_centred @ y_centred) / spread if spread > 0 else math.inf
