"""The rules that a scan of any driver keeps, and what a car needs of a lidar. Pure; the contract is `Scan` in `api.py`.

The car judges by this what drivers from outside deliver, and the conformance kit what all of them do.
"""

import copy
import math
from typing import Any, Final

import numpy as np

from wallride.drivers.api import Scan

MAX_BEAMS: Final = 20_000
MAX_RANGE_M: Final = 300.0
MAX_SWEEP_S: Final = 1.0
FUTURE_S: Final = 0.002
"""Tolerance of a stamp that is ahead of the clock: of two readings of it."""
MOVED_RAD: Final = 0.05
"""Change of an edge of the field from one scan to the next that another number of beams does not explain."""
SIDE_RAD: Final = math.radians(89.5) - 1e-3
"""Minimum field of view to each side: a car needs to see beside itself. Half a degree less than a right angle, because
a field of 180 degrees may end one step short of it; and the rounding of a step, over half a turn."""
MAX_RANGE_MIN_M: Final = 0.3
"""Longest blind ring around a lidar. With 1 m, the car lost a wall from sight before it stood, and drove into it."""
MIN_RATE_HZ: Final = 5.0
COARSEST_DEG: Final = 2.0
"""Of a scan: the coarsest grid of a turning lidar. The speed is bounded by the step as well (decision 47)."""
_SLOW_S: Final = 1.1 / MIN_RATE_HZ
"""Period of a lidar that is too slow, with 10 % for the speed of its head."""
_SLOW_SCANS: Final = 5
"""Long periods in a row that make a lidar too slow; fewer are scans that were lost."""
NUMBERS: Final = ("stamp_s", "received_s", "angle_min_rad", "angle_step_rad", "range_min_m", "range_max_m", "ray_s")


def unfit(right_rad: float, left_rad: float, step_rad: float, range_min_m: float, coarsest_deg: float) -> str:
    """Return why no car can drive by a lidar, as words after its name; "" where one can.

    right_rad, left_rad: bearings of its first and last beam. coarsest_deg: maximum step.
    """
    if left_rad - right_rad < math.tau - 1.5 * step_rad and (right_rad > -SIDE_RAD or left_rad < SIDE_RAD):
        return (
            f"sees from {math.degrees(right_rad):.0f} to {math.degrees(left_rad):.0f} degrees, and a car needs -90"
            " to 90: take a sensor with a wider field, or set its full field"
        )
    if (step_deg := math.degrees(step_rad)) > coarsest_deg * (1 + 1e-6):
        needed = f"{coarsest_deg:g} degree{'s' * (coarsest_deg != 1)}"
        return f"has a beam every {step_deg:.2g} degrees, and a car needs {needed} or less: take a finer sensor"
    if range_min_m > MAX_RANGE_MIN_M:
        return (
            f"sees nothing nearer than {range_min_m:.2g} m, and a car needs {MAX_RANGE_MIN_M:g} m or less: take a"
            " sensor that sees nearer"
        )
    return ""


def too_slow(rate_hz: float) -> str:
    """Return that a lidar turns too slowly, as words after its name; "" where it does not."""
    if rate_hz >= MIN_RATE_HZ:
        return ""
    return f"turns at {rate_hz:.2g} Hz, and a car needs {MIN_RATE_HZ:g} Hz or more: set its motor faster"


class ScanCheck:
    """Judges the scans of one run of a driver, in order."""

    def __init__(self) -> None:
        self._before: Scan | None = None
        self._slow = 0

    def fault(self, scan: object, now_s: float, *, within: bool = False) -> str:
        """Return what is wrong with a scan, as words after the driver's name; "" where it may be used.

        A scan that is merely old is in order: it says so itself. within: its reader has already made NaN of every
        range outside of its limits.
        """
        if not isinstance(scan, Scan):
            return f"delivered a {type(scan).__name__} where a Scan is needed"
        fault = _form(scan) or _time(scan, now_s) or _field(scan) or (_ranges(scan) if not within else "")
        if not fault and self._before is not None:
            fault = _order(scan, self._before) or self._pace(scan.stamp_s - self._before.stamp_s)
        self._before = copy.copy(scan)  # a driver may keep one and write into it
        return fault

    def _pace(self, period_s: float) -> str:
        self._slow = self._slow + 1 if period_s > _SLOW_S else 0
        return too_slow(1 / period_s) if self._slow >= _SLOW_SCANS else ""


def _form(scan: Scan) -> str:
    ranges_m: Any = scan.ranges_m  # whatever it really is
    if isinstance(ranges_m, np.ndarray) and type(ranges_m) is not np.ndarray:  # a mask hides ranges from the rules
        return f"delivered ranges_m as a {type(ranges_m).__name__}: fill it with NaN, numpy.asarray(..., numpy.float32)"
    if not isinstance(ranges_m, np.ndarray) or ranges_m.ndim != 1 or ranges_m.dtype != np.float32:
        return "delivered ranges_m that is no array (n,) of float32"
    if not 2 <= ranges_m.size <= MAX_BEAMS:
        return f"delivered a scan of {ranges_m.size} beams"
    for name in NUMBERS:
        number: Any = getattr(scan, name)
        if not isinstance(number, int | float) or not math.isfinite(number):
            return f"delivered {name} that is no finite {_kind(number, 'float')}"
    sequence: Any = scan.sequence
    return "" if isinstance(sequence, int) else f"delivered a sequence that is no whole {_kind(sequence, 'int')}"


def _kind(number: object, wanted: str) -> str:
    """Return the words after "no": one of numpy's is named, because it prints like a number of Python."""
    return f"number but a numpy.{type(number).__name__}: {wanted}(...)" if isinstance(number, np.generic) else "number"


def _time(scan: Scan, now_s: float) -> str:
    if scan.received_s > now_s + FUTURE_S:
        return f"delivered a scan received {scan.received_s - now_s:.3g} s in the future"
    if scan.stamp_s > scan.received_s + FUTURE_S:
        return f"stamped a scan {scan.stamp_s - scan.received_s:.3g} s after it was received"
    if abs(scan.ray_s) * scan.ranges_m.size > MAX_SWEEP_S:
        return f"delivered ray_s = {scan.ray_s:.3g} s: a sweep of more than {MAX_SWEEP_S:g} s"
    return ""


def _field(scan: Scan) -> str:
    if scan.angle_step_rad <= 0:
        return "delivered an angle_step_rad of 0 or less: beams go from right to left, counter-clockwise"
    sweep_rad = (scan.ranges_m.size - 1) * scan.angle_step_rad
    if sweep_rad > math.tau + scan.angle_step_rad / 2:
        return f"delivered a field of {math.degrees(sweep_rad):.0f} deg: {scan.ranges_m.size} beams of its step"
    if not -math.tau <= scan.angle_min_rad <= math.pi:
        return f"delivered angle_min_rad = {scan.angle_min_rad:.3g}, which is no bearing"
    if not 0 <= scan.range_min_m < scan.range_max_m <= MAX_RANGE_M:
        return f"delivered ranges from {scan.range_min_m:g} to {scan.range_max_m:g} m, which no lidar has"
    return unfit(*_edges_rad(scan), scan.angle_step_rad, scan.range_min_m, COARSEST_DEG)


def _ranges(scan: Scan) -> str:
    low_m, high_m = np.fmin.reduce(scan.ranges_m), np.fmax.reduce(scan.ranges_m)  # NaN only where all are
    if low_m < scan.range_min_m or low_m <= 0.0:
        return f"delivered a beam of {low_m:g} m, nearer than its range_min_m: NaN says that there is no distance"
    if high_m > scan.range_max_m * (1 + 1e-6):
        return f"delivered a beam of {high_m:g} m, farther than its range_max_m: NaN says that there is no distance"
    return ""


def _order(scan: Scan, before: Scan) -> str:
    back_s = before.stamp_s - scan.stamp_s
    if back_s == 0:
        return "repeats a scan"
    if back_s > 0:
        return f"jumped back in time by {back_s:.3g} s"
    if scan.sequence <= before.sequence:
        return f"delivered scan {scan.sequence} after scan {before.sequence}"
    moved_rad = max(abs(now - then) for now, then in zip(_edges_rad(scan), _edges_rad(before), strict=True))
    if moved_rad > MOVED_RAD + max(scan.angle_step_rad, before.angle_step_rad):
        return f"changed its field by {math.degrees(moved_rad):.0f} deg"
    return ""


def _edges_rad(scan: Scan) -> tuple[float, float]:
    return scan.angle_min_rad, scan.angle_min_rad + (scan.ranges_m.size - 1) * scan.angle_step_rad
