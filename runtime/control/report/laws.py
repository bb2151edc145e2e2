"""The lab report's own two laws, as far as it gives them: the baseline of all comparisons.

Wall follower: what `measures` reads from a scan, a corner rule by the beam ahead, and a PD law on distance and angle.
Safety: stop when what is straight ahead is nearer than the tightest turning radius; nearer than 1.5 m, steer fully away
from the wall. The errors of these laws are part of them and stay; docs/decisions/0006-report-law.md lists the origin of
each rule, the readings where the report leaves one open, and where ours differs from its letter.
"""

import math
from dataclasses import replace
from typing import Literal

from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.arbitration.command import NO_LIMIT_MPS
from wallride.runtime.control.guidance import Driver, Follower, Guidance, Verdict
from wallride.runtime.control.report.measures import WallMeasures, measured, middle_beam_m, range_ahead_m
from wallride.runtime.control.report.settings import ReportFollowSettings, ReportSafetySettings
from wallride.runtime.control.vehicle import CarSettings

STEEP_RAD = math.pi / 3


class ReportFollower(Driver):
    """steer = Kd * atan(slope) + Kp * error, towards the wall when positive; 0 when the line is steeper than pi/3.

    Its error is its own distance, in corners that of the corner rule, less the wanted one: what the
    report scores, and not the true error.
    """

    def __init__(self, settings: ReportFollowSettings) -> None:
        self.tune(settings)

    def tune(self, settings: ReportFollowSettings) -> None:
        """Change the settings; the report's law has no state."""
        self._settings = settings
        self._sign = 1.0 if settings.side == "left" else -1.0

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:  # noqa: ARG002 - the report steers without odometry
        """Return the guidance for one scan; no drive with fewer than three valid beams in the side sector."""
        settings = self._settings
        wall = measured(scan, settings.side, by_the_letter=settings.by_the_letter)
        if wall is None:
            return Guidance(None, math.nan, math.nan, math.nan, "no wall in the side sector")
        corner_m = self._corner_distance_m(wall)
        distance_m = wall.distance_m(settings.distance) if corner_m is None else corner_m
        error_m = distance_m - settings.desired_distance_m
        towards_wall_rad = 0.0
        if abs(wall.angle_rad) <= STEEP_RAD:
            towards_wall_rad = settings.kd * wall.angle_rad + settings.kp * error_m
        drive = Drive(settings.speed_mps, self._sign * towards_wall_rad)
        reason = "wall" if corner_m is None else "corner ahead"
        return Guidance(drive, distance_m, error_m, self._sign * wall.angle_rad, reason)

    def _corner_distance_m(self, wall: WallMeasures) -> float | None:
        """Return the distance that counts in a corner, None outside of one."""
        settings = self._settings
        if settings.corner_ahead_m == 0:
            return None
        if settings.corner_rule == "lab3":
            return wall.ahead_m / 2 if wall.ahead_m <= settings.corner_ahead_m else None
        speed_mps = settings.speed_mps
        return wall.ahead_m / speed_mps if speed_mps > 0 and wall.ahead_m <= wall.smallest_m * speed_mps else None


class ReportGuard:
    """Stops when the mean of the three nearest ranges straight ahead is under L / tan(max steering) (0.933 m)."""

    def __init__(self, car: CarSettings, settings: ReportSafetySettings | None = None) -> None:
        self.stop_below_m = car.wheelbase_m / math.tan(car.max_steering_rad)
        self.max_steering_rad = car.max_steering_rad
        self.tune(settings or ReportSafetySettings())

    def tune(self, settings: ReportSafetySettings) -> None:
        """Change the settings."""
        self.turn_below_m = settings.turn_below_m
        self.by_the_letter = settings.by_the_letter

    def ahead_m(self, scan: Scan) -> float:
        """Return the range ahead that both of its rules judge."""
        return middle_beam_m(scan) if self.by_the_letter else range_ahead_m(scan)

    def look(self, scan: Scan, motor: MotorState | None) -> Verdict:  # noqa: ARG002 - the report's rule knows no speed
        """Return the verdict for one scan. Backing out is always allowed: the rule only looks ahead."""
        ahead_m = self.ahead_m(scan)
        if ahead_m < self.stop_below_m:
            return Verdict(0.0, NO_LIMIT_MPS, "obstacle ahead", ahead_m)
        return Verdict(NO_LIMIT_MPS, NO_LIMIT_MPS, "clear", ahead_m)

    def learn(self) -> None:
        """Do nothing: the rule has no state."""


class ReportTurn:
    """The report's second safety rule around a follower: full steering away from the wall before what is near ahead.

    A command like any other: judged by the guard and outranked by the human. In the report the safety controller
    publishes this steering, with its speed left unset; here only the driving source steers, at the follower's speed
    (`by_the_letter`: at 0).
    """

    def __init__(self, follower: Follower, guard: ReportGuard, side: Literal["left", "right"]) -> None:
        self._follower = follower
        self._guard = guard
        self._away = -1.0 if side == "left" else 1.0

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Return the follower's guidance, turned away where an obstacle is nearer than `turn_below_m` ahead."""
        guidance = self._follower.follow(scan, motor)
        if guidance.drive is None or not self._guard.ahead_m(scan) < self._guard.turn_below_m:
            return guidance
        speed_mps = 0.0 if self._guard.by_the_letter else guidance.drive.speed_mps
        turned = Drive(speed_mps, self._away * self._guard.max_steering_rad)
        return replace(guidance, drive=turned, reason="obstacle ahead: turning away")
