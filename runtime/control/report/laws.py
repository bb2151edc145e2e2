"""The lab report's own two laws, unchanged: the baseline of all comparisons.

Wall follower: ranges of the side sector, nonsense under 0.2 m dropped, a line by least squares, the distance as the
mean of the three nearest, Lab 2's corner rule by the beam ahead, and a PD law on distance and angle. Safety: stop when
what is straight ahead is nearer than the tightest turning radius; nearer than 1.5 m, steer fully away from the wall.
The errors of these laws are part of them and stay; docs/decisions/0006-report-law.md lists the origin of each rule.
"""

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from drivers.api import Drive, MotorState, Scan
from runtime.arbitration.command import NO_LIMIT_MPS
from runtime.control.guidance import Follower, Guidance, Verdict
from runtime.control.perception.geometry import Floats, points_m, sector
from runtime.control.report.settings import ReportFollowSettings, ReportSafetySettings
from runtime.control.vehicle import CarSettings

NONSENSE_BELOW_M = 0.2
"""Minimum range that is used: dust on the window reads as centimetres; the report's car once spun in circles for it."""
SIDE_FROM_RAD = 0.1 * math.pi
SIDE_TO_RAD = 0.6 * math.pi
NEAREST_COUNT = 3
STEEP_RAD = math.pi / 3
AHEAD_RAD = math.radians(0.5)
"""Half width of "straight ahead": a few beams, because a single one is often without an echo."""


class ReportFollower:
    """steer = Kd * atan(slope) + Kp * error, towards the wall when positive; 0 when the line is steeper than pi/3."""

    path_m: Floats | None = None
    """It plans no path."""

    def __init__(self, settings: ReportFollowSettings) -> None:
        self.tune(settings)

    def tune(self, settings: ReportFollowSettings) -> None:
        """Change the settings; the report's law has no state."""
        self._settings = settings
        self._sign = 1.0 if settings.side == "left" else -1.0

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:  # noqa: ARG002 - the report steers without odometry
        """Return the guidance for one scan; no drive with fewer than three valid beams in the side sector."""
        settings = self._settings
        x_m, y_m = self._side_points_m(scan)
        if x_m.size < NEAREST_COUNT:
            return Guidance(None, math.nan, math.nan, math.nan, "no wall in the side sector")
        angle_rad = math.atan(_slope(x_m, y_m))
        distance_m = mean_of_nearest_m(np.hypot(x_m, y_m))
        ahead_m = range_ahead_m(scan)
        cornering = ahead_m <= settings.corner_ahead_m
        if cornering:
            distance_m = ahead_m / 2
        error_m = distance_m - settings.desired_distance_m
        towards_wall_rad = 0.0
        if abs(angle_rad) <= STEEP_RAD:
            towards_wall_rad = settings.kd * angle_rad + settings.kp * error_m
        drive = Drive(settings.speed_mps, self._sign * towards_wall_rad)
        return Guidance(drive, distance_m, error_m, self._sign * angle_rad, "corner ahead" if cornering else "wall")

    def _side_points_m(self, scan: Scan) -> Floats:
        """Return the side sector's points as (2, n): x ahead, y towards the followed wall, whichever side that is."""
        part = (
            sector(scan, SIDE_FROM_RAD, SIDE_TO_RAD) if self._sign > 0 else sector(scan, -SIDE_TO_RAD, -SIDE_FROM_RAD)
        )
        points = points_m(scan, part)[:, scan.ranges_m[part] > NONSENSE_BELOW_M]  # NaN compares as not greater
        points[1] *= self._sign
        return points


class ReportGuard:
    """Stops when the mean of the three nearest ranges straight ahead is under L / tan(max steering) (0.933 m)."""

    words: tuple[str, ...] = ()
    """Faults of the lidar's window: never any, it is not monitored."""

    def __init__(self, car: CarSettings, settings: ReportSafetySettings | None = None) -> None:
        self.stop_below_m = car.wheelbase_m / math.tan(car.max_steering_rad)
        self.max_steering_rad = car.max_steering_rad
        self.tune(settings or ReportSafetySettings())

    def tune(self, settings: ReportSafetySettings) -> None:
        """Change the settings."""
        self.turn_below_m = settings.turn_below_m

    def look(self, scan: Scan, motor: MotorState | None) -> Verdict:  # noqa: ARG002 - the report's rule knows no speed
        """Return the verdict for one scan. Backing out is always allowed: the rule only looks ahead."""
        ahead_m = range_ahead_m(scan)
        if ahead_m < self.stop_below_m:
            return Verdict(0.0, NO_LIMIT_MPS, "obstacle ahead", ahead_m)
        return Verdict(NO_LIMIT_MPS, NO_LIMIT_MPS, "clear", ahead_m)

    def learn(self) -> None:
        """Do nothing: the rule has no state."""


class ReportTurn:
    """The report's second safety rule around a follower: full steering away from the wall before what is near ahead.

    A command like any other, at the follower's own speed: judged by the guard and outranked by the human. In the report
    the safety controller publishes this steering; here only the driving source steers.
    """

    def __init__(self, follower: Follower, guard: ReportGuard, side: Literal["left", "right"]) -> None:
        self._follower = follower
        self._guard = guard
        self._away = -1.0 if side == "left" else 1.0

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Return the follower's guidance, turned away where an obstacle is nearer than `turn_below_m` ahead."""
        guidance = self._follower.follow(scan, motor)
        if guidance.drive is None or not range_ahead_m(scan) < self._guard.turn_below_m:
            return guidance
        turned = Drive(guidance.drive.speed_mps, self._away * self._guard.max_steering_rad)
        return replace(guidance, drive=turned, reason="obstacle ahead: turning away")


def range_ahead_m(scan: Scan) -> float:
    """Return the mean of the three nearest usable ranges straight ahead, infinity when there are none.

    Infinity here is the report's own reading of "no echo" and one of its weaknesses.
    """
    ranges_m = scan.ranges_m[sector(scan, -AHEAD_RAD, AHEAD_RAD)]
    usable_m = ranges_m[ranges_m > NONSENSE_BELOW_M]
    return mean_of_nearest_m(usable_m.astype(np.float64)) if usable_m.size else math.inf


def mean_of_nearest_m(ranges_m: Floats) -> float:
    """Return the mean of the three smallest values (of all of them when there are fewer)."""
    count = min(NEAREST_COUNT, ranges_m.size)
    return float(np.partition(ranges_m, count - 1)[:count].mean())


def _slope(x_m: Floats, y_m: Floats) -> float:
    """Return dy/dx of the least-squares line; a vertical pile of points has an infinite slope."""
    x_centred, y_centred = x_m - x_m.mean(), y_m - y_m.mean()
    spread = float(x_centred @ x_centred)
    return float(x_centred @ y_centred) / spread if spread > 0 else math.inf
