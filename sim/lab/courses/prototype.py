"""The design notes' two-gain prototype: a baseline for the follower `ball`, for comparisons in the lab only.

It rolls a ball of the wanted distance D along one piece of wall, as `ball` does, and steers by two numbers:

    steering = kp (d_nearest - D + b) + kd phi          kp 0.35 rad/m, kd 1.5

phi is the first of 69 bearings, from the free side to the wall side, at which a point on a circle of radius
0.4 m + 0.3 s v is nearer to the wall than D; b is how much too near the nearest of noisy points is. It goes as fast as
the notes' speed profile allows on the friction that they assume where no floor was measured. Of what the notes call
optional (learning the trim, bridging glass) it has nothing. All within is for a wall on the left.
"""

import math
from itertools import pairwise
from typing import Final

import numpy as np

from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings
from wallride.runtime.control.wall_following.followed_wall import SideView, side_view
from wallride.runtime.control.wall_following.wall_fit import CLEAN_INLIERS, WallLine
from wallride.sim.world.pose import Floats, Side, side_sign

KP_RAD_PER_M, KD = 0.35, 1.5
LOOK_AHEAD_M, LOOK_AHEAD_S = 0.4, 0.3
PREDICTED_S = 0.045
MU = 0.5
"""Friction assumed by the speed profile: "0.5 until a floor is measured"."""
CAP_M, GAP_DIAMETERS, MAX_GAP_M = 3.5, 1.8, 1.6
BESIDE_FROM_RAD, BESIDE_TO_RAD = math.radians(11), math.radians(132)
MIN_POINTS, SMOOTHED_POINTS, THINNED_TO_M = 5, 5, 0.06
ROOM_ALONG_M, ROOM_NEAREST_SHARE, ROOM_MIN_GAIN_M = 0.5, 0.1, 0.03
BIAS_ABOVE_M, BIAS_BELOW_M, BIAS_LOW_PASS = -0.02, 0.12, 0.1
FADE_PER_SCAN, NO_WALL_MPS = 0.05, 0.5
LATERAL_SHARE, BRAKE_SHARE = 0.75, 0.6
SHARPEST_PER_M, SEGMENT_EXTRA_M, MARGIN_M, REACTION_S = 0.9, 0.15, 0.3, 0.06
_BEARINGS_RAD: Final = np.radians(np.linspace(-85.0, 85.0, 69))
_PROFILE_RADII_M: Final = np.linspace(0.3, 3.0, 10)


class Prototype:
    """Implements Follower; its settings are constants."""

    def __init__(self, side: Side, desired_m: float, speed_mps: float, car: CarSettings, eyes: ViewCache) -> None:
        self._side: Side = side
        self._desired_m, self._speed_mps = desired_m, speed_mps
        self._car = car
        self._eyes = eyes
        self._bias_m = self._steering_rad = 0.0

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Return the command for one scan."""
        seen = side_view(self._eyes.see(scan), self._side)
        sign = side_sign(self._side)
        speed_mps = motor.speed_mps if motor is not None else 0.0
        wall_m = wall_points_m(seen, self._desired_m)
        if wall_m is None:
            self._steering_rad *= 1.0 - FADE_PER_SCAN
            drive = Drive(min(NO_WALL_MPS, self._speed_mps), sign * self._steering_rad)
            return Guidance(drive, math.nan, math.nan, math.nan, "no wall: going on slowly")
        line = seen.side.lines.find(seen.x_m, seen.y_m, seen.range_m, seen.solid)
        desired_m = self._desired_m if line is None else room_m(seen, line, self._desired_m)
        wheel_rad = sign * motor.steering_rad if motor is not None else 0.0
        wall_m, line = self._predicted(wall_m, line, speed_mps, wheel_rad)
        nearest_m = float(np.hypot(*wall_m).min())
        if line is not None and line.inliers > CLEAN_INLIERS:
            found_m = line.distance_m - nearest_m
            if BIAS_ABOVE_M < found_m < BIAS_BELOW_M:
                self._bias_m += BIAS_LOW_PASS * (found_m - self._bias_m)
        ball_m = desired_m - self._bias_m
        phi_rad = target_rad(wall_m, LOOK_AHEAD_M + LOOK_AHEAD_S * speed_mps, ball_m)[0]
        most_rad = self._car.max_steering_rad
        steering_rad = KP_RAD_PER_M * (nearest_m - ball_m) + KD * phi_rad
        self._steering_rad = min(max(steering_rad, -most_rad), most_rad)
        drive = Drive(min(self._speed_mps, self._fastest_mps(wall_m, ball_m, speed_mps)), sign * self._steering_rad)
        heading_rad = sign * line.heading_rad if line is not None else math.nan
        return Guidance(drive, nearest_m + self._bias_m, nearest_m - ball_m, heading_rad, "wall")

    def _predicted(
        self, wall_m: Floats, line: WallLine | None, speed_mps: float, wheel_rad: float
    ) -> tuple[Floats, WallLine | None]:
        """Return the wall predicted PREDICTED_S ahead."""
        way_m = speed_mps * PREDICTED_S
        turn_rad = way_m * math.tan(wheel_rad) / self._car.wheelbase_m
        x_m, y_m = way_m * math.cos(turn_rad / 2), way_m * math.sin(turn_rad / 2)
        cos, sin = math.cos(turn_rad), math.sin(turn_rad)
        dx, dy = wall_m[0] - x_m, wall_m[1] - y_m
        there = np.stack([cos * dx + sin * dy, cos * dy - sin * dx])
        return there, None if line is None else line.seen_from(x_m, y_m, turn_rad)

    def _fastest_mps(self, wall_m: Floats, ball_m: float, speed_mps: float) -> float:
        """Return the speed allowed by the curvature of the steering and of the ball's path ahead."""
        lateral, brake = LATERAL_SHARE * MU * GRAVITY_MPS2, BRAKE_SHARE * MU * GRAVITY_MPS2
        now = lateral / max(abs(math.tan(self._steering_rad)) / self._car.wheelbase_m, 1e-6)
        square, margin_m = now, MARGIN_M + REACTION_S * abs(speed_mps)
        places: list[tuple[float, float]] = []
        for radius_m in _PROFILE_RADII_M.tolist():
            bearing_rad, found = target_rad(wall_m, radius_m, ball_m)
            if not found:
                break
            places.append((radius_m * math.cos(bearing_rad), radius_m * math.sin(bearing_rad)))
        way_m = math.hypot(*places[0]) if places else 0.0
        heading_rad = math.nan
        for (x0, y0), (x1, y1) in pairwise(places):
            before_rad, heading_rad = heading_rad, math.atan2(y1 - y0, x1 - x0)
            length_m = math.hypot(x1 - x0, y1 - y0)
            if not math.isnan(before_rad):
                turn_rad = abs(math.remainder(heading_rad - before_rad, math.tau))
                per_m = min(max(turn_rad / (length_m + SEGMENT_EXTRA_M), 1e-3), SHARPEST_PER_M)
                square = min(square, lateral / per_m + 2 * brake * max(way_m - margin_m, 0.0))
            way_m += length_m
        return math.sqrt(min(square, lateral / SHARPEST_PER_M + 2 * brake * max(way_m - margin_m, 0.0)))


def wall_points_m(seen: SideView, desired_m: float) -> Floats | None:
    """Return the followed piece of wall, smoothed and thinned, (2, n), or None without one."""
    index = np.flatnonzero(seen.solid & (seen.range_m < CAP_M))
    bearing_rad = seen.side.bearing_rad[index]
    beside = np.flatnonzero((bearing_rad >= BESIDE_FROM_RAD) & (bearing_rad <= BESIDE_TO_RAD))
    if not beside.size:
        return None
    points = np.stack([seen.x_m[index], seen.y_m[index]])
    apart_m = np.hypot(*(points[:, 1:] - points[:, :-1]))
    piece = np.concatenate([[0], np.cumsum(apart_m > min(GAP_DIAMETERS * desired_m, MAX_GAP_M))])
    mine = points[:, piece == piece[beside[seen.range_m[index[beside]].argmin()]]]
    if mine.shape[1] < MIN_POINTS:
        return None
    half, smooth = SMOOTHED_POINTS // 2, mine.copy()
    kernel = np.ones(SMOOTHED_POINTS) / SMOOTHED_POINTS
    for row in range(2):
        smooth[row, half : mine.shape[1] - half] = np.convolve(mine[row], kernel, "valid")
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*(smooth[:, 1:] - smooth[:, :-1])))])
    thinned: Floats = smooth[:, np.unique((along / THINNED_TO_M).astype(np.intp), return_index=True)[1]]
    return thinned


def room_m(seen: SideView, line: WallLine, desired_m: float) -> float:
    """Return D, or half of the free width between the wall's line and the opposite side if that is less."""
    cos, sin = math.cos(line.heading_rad), math.sin(line.heading_rad)
    along, across = cos * seen.x_m + sin * seen.y_m, sin * seen.x_m - cos * seen.y_m
    opposite = np.sort(across[seen.solid & (np.abs(along) < ROOM_ALONG_M) & (across > 0.0)])
    if opposite.size < MIN_POINTS:
        return desired_m
    nearest = max(1, round(ROOM_NEAREST_SHARE * opposite.size))
    half_m = (line.distance_m + float(opposite[:nearest].mean())) / 2
    return half_m if half_m < desired_m - ROOM_MIN_GAIN_M else desired_m


def target_rad(wall_m: Floats, radius_m: float, ball_m: float) -> tuple[float, bool]:
    """Return the bearing on a circle at which the ball is, and whether the wall is within D anywhere on it.

    Otherwise the bearing nearest to the wall; the first one if that is too near already.
    """
    x, y = radius_m * np.cos(_BEARINGS_RAD), radius_m * np.sin(_BEARINGS_RAD)
    far_m = np.hypot(wall_m[0][:, None] - x, wall_m[1][:, None] - y).min(axis=0)
    below = np.flatnonzero(far_m < ball_m)
    if not below.size:
        return float(_BEARINGS_RAD[int(far_m.argmin())]), False
    first = int(below[0])
    if first == 0:
        return float(_BEARINGS_RAD[0]), True
    share = (far_m[first - 1] - ball_m) / (far_m[first - 1] - far_m[first])
    return float(_BEARINGS_RAD[first - 1] + share * (_BEARINGS_RAD[first] - _BEARINGS_RAD[first - 1])), True
