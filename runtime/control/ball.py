"""Follows a wall by steering after a ball that is rolled along it.

    steering = kp (d - D + b) + kd phi + trim,   clipped to what the car can do

d: distance of the nearest wall point from the rear axle, b: how much noise makes it too near, D: radius of the ball,
phi: bearing of the ball on the circle of the look-ahead distance. All of it seen from where the car will be when the
answer takes effect. The follower never guesses: without a piece of wall it says so and does what the settings say.
"""

import math

import numpy as np

from drivers.api import Drive, MotorState, Scan
from runtime.control.ball_path import RADII_M, ball_path
from runtime.control.ball_settings import BallSettings
from runtime.control.guidance import Guidance
from runtime.control.lost import SEARCH_PER_M, Lost
from runtime.control.my_wall import bridge_glass, my_wall, outline, roomy_m, side_view
from runtime.control.perception import Eyes
from runtime.control.prediction import Predictor
from runtime.control.speed_profile import profile_mps, speed_limit_mps
from runtime.control.trim import NoiseBias, Trim
from runtime.car_settings import CarSettings

LONGEST_STEP_S = 0.25
CORNER_M=1.0; CORNER_S=0.1; DEAD_RAD=.05; KINK0=.3; KINK1=.6; FF=1.0; SLIP=.037; STRAIGHT=9.
def _asin(x):
    return math.asin(min(max(x, -.95), .95))
def bend(path):
    if not path.meets[1:5].all(): return 0.0
    x = (path.radius_m[1:5]*np.cos(path.bearing_rad[1:5])).tolist()
    y = (path.radius_m[1:5]*np.sin(path.bearing_rad[1:5])).tolist()
    turn = math.atan2(y[3]-y[2],x[3]-x[2])-math.atan2(y[1]-y[0],x[1]-x[0])
    way = (math.hypot(x[2]-x[0],y[2]-y[0])+math.hypot(x[3]-x[1],y[3]-y[1]))/2
    return math.remainder(turn, math.tau)/way


class BallFollower:
    """Rolling-ball follower; see the module's docstring for the law and `BallSettings` for its numbers."""

    def __init__(self, settings: BallSettings, car: CarSettings, eyes: Eyes) -> None:
        self._settings = settings
        self._car = car
        self._eyes = eyes
        self._sign = 1.0 if settings.side == "left" else -1.0
        self._predictor = Predictor(car.wheelbase_m, car.steering_rate_radps)
        self._bias = NoiseBias()
        self._trim = Trim()
        self._curv = 0.
        search_rad = math.atan(SEARCH_PER_M * car.wheelbase_m)
        self._lost = Lost(
            settings.no_wall, min(settings.no_wall_speed_mps, settings.speed_mps), settings.search_at_most_m, search_rad
        )
        self._stamp_s = math.nan

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan."""
        s = self._settings
        seen = side_view(self._eyes.see(scan), s.side)
        speed_mps = motor.speed_mps if motor is not None else 0.0
        moved_m = self._moved_m(scan, speed_mps)
        shift = self._shift(scan, motor)
        wall = my_wall(seen, s.desired_distance_m)
        if wall is None:
            return self._without_wall(moved_m)
        line = seen.side.lines.find(seen.x_m, seen.y_m, seen.range_m, seen.solid)
        desired_m = roomy_m(seen, line, s.desired_distance_m)
        points = outline(seen.x_m[wall], seen.y_m[wall])
        glass = bridge_glass(seen, wall, line) if line is not None else None
        if glass is not None:
            points = np.concatenate((points, glass), axis=1)
        points = shift.seen_from_there(points)
        nearest_m = math.sqrt(float(np.einsum("ij,ij->j", points, points).min()))
        line_m = heading_rad = math.nan
        if line is not None:
            heading_rad = line.heading_rad - shift.yaw_rad
            line_m = line.distance_m - float(
                math.cos(line.heading_rad) * shift.y_m - math.sin(line.heading_rad) * shift.x_m
            )
        bias_m = self._bias.learn(line if abs(self._curv) < STRAIGHT else None, line_m, nearest_m)
        error_m = nearest_m + bias_m - desired_m
        look_m = s.look_ahead_m + s.look_ahead_s * abs(speed_mps)
        far_m = CORNER_M + CORNER_S * abs(speed_mps)
        path = ball_path(points, np.append(RADII_M, (look_m, far_m)), desired_m - bias_m)
        phi_rad = float(path.bearing_rad[-2])
        phi_rad = min(phi_rad, float(path.bearing_rad[-1]) + DEAD_RAD + _asin(error_m/look_m) - _asin(error_m/far_m))
        curvature = bend(path)
        self._curv = curvature
        curvature *= min(max((curvature + KINK1) / (KINK1 - KINK0), 0.0), 1.0)
        steering_rad = s.kp * error_m + s.kd * phi_rad
        steering_rad -= s.kd * (math.asin(min(max(curvature * look_m / 2, -.9), .9)) - SLIP * speed_mps**2 * curvature) - math.atan(self._car.wheelbase_m * curvature)
        if s.trim_integral:
            steering_rad += self._trim.learn(line, error_m, phi_rad, moved_m)
        most = self._car.max_steering_rad
        steering_rad = min(max(steering_rad, -most), most)
        self._lost.found(steering_rad)
        wanted_mps = s.speed_mps
        if s.speed_profile:
            wanted_mps = min(
                wanted_mps,
                speed_limit_mps(steering_rad, self._car.wheelbase_m, s.assumed_mu),
                profile_mps(path.first(RADII_M.size), speed_mps, s.assumed_mu),
            )
        drive = Drive(wanted_mps, self._sign * steering_rad)
        return Guidance(drive, nearest_m + bias_m, error_m, self._sign * heading_rad, "wall")

    def _moved_m(self, scan: Scan, speed_mps: float) -> float:
        since_s = scan.stamp_s - self._stamp_s
        self._stamp_s = scan.stamp_s
        return speed_mps * since_s if 0.0 < since_s < LONGEST_STEP_S else 0.0

    def _shift(self, scan, motor):
        ahead_s = self._settings.latency_s + min(max(scan.received_s - scan.stamp_s, 0.0), LONGEST_STEP_S)
        shift = self._predictor.shift(scan.stamp_s, motor, ahead_s)
        return shift if self._sign > 0 else shift.mirrored()

    def _without_wall(self, moved_m: float) -> Guidance:
        drive, reason = self._lost.drive(moved_m)
        if drive is not None:
            drive = Drive(drive.speed_mps, self._sign * drive.steering_rad)
        return Guidance(drive, math.nan, math.nan, math.nan, reason)
