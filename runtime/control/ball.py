"""Follows a wall by steering after a ball that is rolled along it.

One scan at a time: find my wall, see it from where the car will be when the answer takes effect (`prediction`), roll a
ball of the wanted distance along it (`ball_path`), steer after the ball (`ball_law`), and go no faster than its path
allows (`speed_profile`). Without a piece of wall the follower says so and does what the settings say (`lost`).
Everything between the mirror at the entrance and the one at the exit is for a wall on the left.
"""

import math

import numpy as np

from drivers.api import Drive, MotorState, Scan
from runtime.car_settings import CarSettings
from runtime.control.ball_law import ball_bearing_rad, bend_correction_rad, look_aheads_m
from runtime.control.ball_path import RADII_M, BallPath, ball_path, bend_per_m
from runtime.control.ball_settings import BallSettings
from runtime.control.geometry import Floats
from runtime.control.guidance import Guidance
from runtime.control.lost import SEARCH_PER_M, Lost
from runtime.control.my_wall import Beams, SideView, bridge_glass, my_wall, outline, roomy_m, side_view
from runtime.control.perception import Eyes
from runtime.control.prediction import Predictor, Shift
from runtime.control.speed_profile import profile_mps, speed_limit_mps
from runtime.control.trim import NoiseBias, Trim
from runtime.control.wall import Line

LONGEST_STEP_S = 0.25
"""Between two scans; after a longer silence the way since is not known."""


class BallFollower:
    """The rolling-ball follower; `BallSettings` has its numbers."""

    def __init__(self, settings: BallSettings, car: CarSettings, eyes: Eyes) -> None:
        self._settings = settings
        self._car = car
        self._eyes = eyes
        self._sign = 1.0 if settings.side == "left" else -1.0
        self._predictor = Predictor(car.wheelbase_m, car.steering_rate_radps)
        self._bias = NoiseBias()
        self._trim = Trim()
        self._lost = Lost(
            settings.no_wall,
            min(settings.no_wall_speed_mps, settings.speed_mps),
            settings.search_at_most_m,
            math.atan(SEARCH_PER_M * car.wheelbase_m),
        )
        self._stamp_s = math.nan

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan."""
        settings = self._settings
        speed_mps = motor.speed_mps if motor is not None else 0.0
        moved_m = self._moved_m(scan.stamp_s, speed_mps)
        shift = self._shift(scan, motor)
        seen = side_view(self._eyes.see(scan), settings.side)
        wall = my_wall(seen, settings.desired_distance_m)
        if wall is None:
            return self._without_wall(moved_m)
        line = seen.side.lines.find(seen.x_m, seen.y_m, seen.range_m, seen.solid)
        desired_m = roomy_m(seen, line, settings.desired_distance_m)
        points_m = shift.seen_from_there(_wall_points_m(seen, wall, line))
        line = line.seen_from(shift.x_m, shift.y_m, shift.yaw_rad) if line is not None else None
        nearest_m = math.sqrt(float(np.einsum("ij,ij->j", points_m, points_m).min()))
        bias_m = self._bias.learn(line, nearest_m)
        distance_m = nearest_m + bias_m
        look_m = look_aheads_m(settings.look_ahead_m, settings.look_ahead_s, speed_mps)
        path = ball_path(points_m, desired_m - bias_m, look_m)
        steering_rad = self._steering_rad(path, line, distance_m - desired_m, speed_mps, moved_m)
        self._lost.found(steering_rad)
        drive = Drive(self._speed_mps(path, steering_rad, speed_mps), self._sign * steering_rad)
        angle_rad = self._sign * line.heading_rad if line is not None else math.nan
        return Guidance(drive, distance_m, distance_m - desired_m, angle_rad, "wall")

    def _steering_rad(
        self, path: BallPath, line: Line | None, error_m: float, speed_mps: float, moved_m: float
    ) -> float:
        settings, car = self._settings, self._car
        phi_rad = ball_bearing_rad(path, error_m)
        steering_rad = settings.kp * error_m + settings.kd * phi_rad
        steering_rad += bend_correction_rad(
            bend_per_m(path), float(path.radius_m[-2]), speed_mps, settings.kd, car.wheelbase_m
        )
        if settings.trim_integral:
            steering_rad += self._trim.learn(line, error_m, phi_rad, moved_m)
        return min(max(steering_rad, -car.max_steering_rad), car.max_steering_rad)

    def _speed_mps(self, path: BallPath, steering_rad: float, speed_mps: float) -> float:
        settings = self._settings
        if not settings.speed_profile:
            return settings.speed_mps
        now_mps = speed_limit_mps(steering_rad, self._car.wheelbase_m, settings.assumed_mu)
        ahead_mps = profile_mps(path.first(RADII_M.size), speed_mps, settings.assumed_mu)
        return min(settings.speed_mps, now_mps, ahead_mps)

    def _moved_m(self, stamp_s: float, speed_mps: float) -> float:
        """Return the way since the last scan."""
        since_s = stamp_s - self._stamp_s
        self._stamp_s = stamp_s
        return speed_mps * since_s if 0.0 < since_s < LONGEST_STEP_S else 0.0

    def _shift(self, scan: Scan, motor: MotorState | None) -> Shift:
        """Return the motion until the answer takes effect: the latency, and the age of a scan that came late."""
        late_s = min(max(scan.received_s - scan.stamp_s, 0.0), LONGEST_STEP_S)
        shift = self._predictor.shift(scan.stamp_s, motor, self._settings.latency_s + late_s)
        return shift if self._sign > 0 else shift.mirrored()

    def _without_wall(self, moved_m: float) -> Guidance:
        drive, reason = self._lost.drive(moved_m)
        if drive is not None:
            drive = Drive(drive.speed_mps, self._sign * drive.steering_rad)
        return Guidance(drive, math.nan, math.nan, math.nan, reason)


def _wall_points_m(seen: SideView, wall: Beams, line: Line | None) -> Floats:
    """Return my wall as thinned points (2, n), panes of glass filled in."""
    points_m = outline(seen.x_m[wall], seen.y_m[wall])
    glass_m = bridge_glass(seen, wall, line) if line is not None else None
    return points_m if glass_m is None else np.concatenate((points_m, glass_m), axis=1)
