"""Distances that the lab report's law reads, through a sharp turn, which its authors wanted to plot next.

Range ahead, mean of the three nearest, distance to the fitted line, and the turn radius of the steering sent.
"""

import numpy as np

from wallride.drivers.api import Scan
from wallride.runtime.control.report.measures import measured
from wallride.sim.replay.drive_log import LoggedMessage, decode
from wallride.sim.replay.figures import at_time
from wallride.sim.replay.run import RecordedRun
from wallride.sim.run_report.charts import ChartLine, over_time
from wallride.sim.world.pose import Floats

TOP_M = 5.0
"""Larger distances and radii are not drawn."""
WINDOW_S = 6.0
SHARP_OVER_S = 1.0
"""Time over which the mean steering finds the sharpest turn."""
SHARP_RAD = 0.15
"""Minimum mean steering of a sharp turn."""
ABOUT_TURN = (
    "What the lab report's law reads of the followed side, whichever law drove: range ahead, mean of the three nearest,"
    f" distance to the fitted line; and the turn radius of the steering sent. Up to {TOP_M:g} m."
)


def turn_chart(time_s: Floats, ahead_m: Floats, nearest_m: Floats, line_m: Floats, radius_m: Floats) -> str:
    """Return the four over time as SVG text."""
    named = (("range ahead", ahead_m), ("three nearest", nearest_m), ("line", line_m), ("turn radius", radius_m))
    lines = [
        ChartLine(name, time_s, np.where(values_m <= TOP_M, values_m, np.nan), style)
        for (name, values_m), style in zip(named, ("s1", "s2", "s4", "s3"), strict=True)
    ]
    return over_time(lines, "m")


def sharpest_turn(run: RecordedRun) -> str:
    """Return the chart around the sharpest turn of a drive, "" where it has none."""
    steering = run.steering
    middle_s = _sharpest_s(steering.time_s, steering.value)
    if middle_s is None:
        return ""
    rows = []
    for time_s, message in run.scans:
        if abs(time_s - middle_s) > WINDOW_S / 2:
            continue
        wall = measured(_scan(message), run.settings.wall_follow.side)
        steering_rad = at_time(steering.time_s, steering.value, time_s)
        with np.errstate(divide="ignore"):
            radius_m = run.settings.car.wheelbase_m / np.abs(np.tan(steering_rad))
        if wall is not None:
            rows.append((time_s, wall.ahead_m, wall.three_smallest_m, wall.line_m, float(radius_m)))
    if len(rows) < 2:
        return ""
    return turn_chart(*np.array(rows).T)


def _sharpest_s(time_s: Floats, steering_rad: Floats) -> float | None:
    """Return the middle of the second with the largest mean steering, None where no turn is sharp."""
    if time_s.size < 2:
        return None
    grid_s = np.arange(time_s[0], time_s[-1], 0.05)
    newest = np.searchsorted(time_s, grid_s, side="right") - 1
    width = round(SHARP_OVER_S / 0.05)
    if grid_s.size < width:
        return None
    mean_rad = np.abs(np.convolve(steering_rad[newest], np.full(width, 1 / width), "valid"))
    at = int(np.argmax(mean_rad))
    return float(grid_s[at] + SHARP_OVER_S / 2) if mean_rad[at] >= SHARP_RAD else None


def _scan(message: LoggedMessage) -> Scan:
    """Return a recorded scan as the laws had it; ranges outside of the sensor's are NaN."""
    told = decode(message)
    ranges_m = np.asarray(told.ranges, np.float32)
    ranges_m = np.where((ranges_m >= told.range_min) & (ranges_m <= told.range_max), ranges_m, np.float32(np.nan))
    return Scan(
        0.0, 0.0, float(told.angle_min), float(told.angle_increment), float(told.range_min), float(told.range_max),
        ranges_m, 0,
    )  # fmt: skip
