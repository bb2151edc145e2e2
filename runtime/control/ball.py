"""Follows a wall by steering after a ball that is rolled along it.

One scan at a time: find my wall, see it from where the car will be when the answer takes effect (`prediction`), roll a
ball of the wanted distance along it (`ball_path`), steer after the ball (`ball_law`), and go no faster than its path
allows (`speed_profile`). Beside a straight wall the tracked line (`wall_track`) says more exactly than one scan's
points where the wall is. Without a piece of wall the follower says so and does what the settings say (`lost`).
Everything between the mirror at the entrance and the one at the exit is for a wall on the left.
"""

import math

import numpy as np

from drivers.api import Drive, MotorState, Scan
from runtime.car_settings import CarSettings
from runtime.control.ball_law import Aim, look_aheads_m, pursued
from runtime.control.ball_path import RADII_M, BallPath, WallPoints, ball_path, bend_per_m
from runtime.control.ball_settings import BallSettings
from runtime.control.geometry import Floats
from runtime.control.guidance import Guidance
from runtime.control.lost import SEARCH_PER_M, Lost
from runtime.control.my_wall import Beams, SideView, bridge_glass, my_wall, outline, side_view, wall_around
from runtime.control.noise_bias import NoiseBias
from runtime.control.perception import Eyes
from runtime.control.prediction import Predictor, Shift
from runtime.control.room import Room
from runtime.control.speed_profile import mu_with_room, profile_mps, speed_limit_mps
from runtime.control.wall import Line
from runtime.control.wall_track import WallTrack

LONGEST_STEP_S = 0.25
"""Between two scans; after a longer silence the way since is not known."""
TOO_NEAR_M = 0.05
SLIPPING_SHARE = 0.3
"""A car that is so much nearer to the wall than it should be, and comes nearer still with the wheels turned away as far
as they can, may be on a floor that gives less than counted on: it goes on by this share of it."""
BEND_LOW_PASS = 0.2
"""By which the path's bend is averaged before it tells a bent wall from a straight one."""


class BallFollower:
    """The rolling-ball follower; `BallSettings` has its numbers."""

    def __init__(self, settings: BallSettings, car: CarSettings, eyes: Eyes) -> None:
        self._settings = settings
        self._car = car
        self._eyes = eyes
        self._sign = 1.0 if settings.side == "left" else -1.0
        self._predictor = Predictor(car.wheelbase_m, car.steering_rate_radps)
        self._bias = NoiseBias()
        self._track = WallTrack(car.wheelbase_m)
        self._room = Room()
        self._bend_per_m = 0.0
        self._straight = 0.0
        self._lost = Lost(
            settings.no_wall,
            min(settings.no_wall_speed_mps, settings.speed_mps),
            settings.search_at_most_m,
            math.atan(SEARCH_PER_M * car.wheelbase_m),
        )
        self._stamp_s = math.nan
        self._path: BallPath | None = None

    @property
    def path_m(self) -> Floats | None:
        """Where the ball of the newest scan runs, (2, k) in base_link; None without a wall. For drawings."""
        if self._path is None:
            return None
        path = self._path.first(len(RADII_M))
        places = zip(path.radius_m, path.bearing_rad, path.crosses, strict=True)
        crossed = [(r * math.cos(b), self._sign * r * math.sin(b)) for r, b, crosses in places if crosses]
        return np.array(crossed, np.float64).reshape(-1, 2).T

    def tune(self, settings: BallSettings) -> None:
        """Go on with other settings; what was learnt stays. On the other side, what was learnt is mirrored."""
        self._lost.tune(
            settings.no_wall, min(settings.no_wall_speed_mps, settings.speed_mps), settings.search_at_most_m
        )
        if settings.side != self._settings.side:
            self._sign = -self._sign
            self._track.mirror()
            self._lost.found(0.0)
        self._settings = settings

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan."""
        settings = self._settings
        speed_mps = motor.speed_mps if motor is not None else 0.0
        moved_m = self._moved_m(scan.stamp_s, speed_mps)
        shift = self._shift(scan, motor)
        wheel_rad = self._sign * self._predictor.wheel_rad
        expected = self._track.expect(moved_m, wheel_rad, speed_mps, straight=self._straight >= 1.0)
        seen = side_view(self._eyes.see(scan), settings.side)
        mine = my_wall(seen, self._room.within_m(settings.desired_distance_m))
        if mine is None:
            self._path = None
            self._track.correct(None)
            return self._without_wall(moved_m)
        line = seen.side.lines.find(seen.x_m, seen.y_m, seen.range_m, seen.solid, expected)
        tracked = self._track.correct(line)
        desired_m = self._room.beside_m(seen, line, settings.desired_distance_m, moved_m)
        wall = _wall_points(seen, mine, line, shift)
        line_now, line, tracked = line, _from_there(line, shift), _from_there(tracked, shift)
        bias_m = self._bias.learn(line, wall.nearest_m)
        path = ball_path(
            wall, desired_m - bias_m, look_aheads_m(settings.look_ahead_m, settings.look_ahead_s, speed_mps)
        )
        self._path = path
        bend = bend_per_m(path)
        self._bend_per_m += BEND_LOW_PASS * (bend - self._bend_per_m)
        aim, steering_rad = self._pursuit(path, tracked, wall.nearest_m + bias_m, desired_m, bend, speed_mps)
        self._straight = aim.straight
        self._lost.found(steering_rad)
        mu = mu_with_room(settings.assumed_mu, desired_m)
        if self._slips(aim, steering_rad):
            mu *= SLIPPING_SHARE
        drive = Drive(self._speed_mps(path, steering_rad, speed_mps, mu), self._sign * steering_rad)
        self._predictor.answers.said(scan.received_s, drive.steering_rad)
        angle_rad, line_m = math.nan, math.nan
        if line_now is not None:
            angle_rad, line_m = self._sign * line_now.heading_rad, line_now.distance_m
        return Guidance(drive, aim.error_m + desired_m, aim.error_m, angle_rad, "wall", line_m)

    def _pursuit(
        self, path: BallPath, line: Line | None, nearest_m: float, desired_m: float, bend: float, speed_mps: float
    ) -> tuple[Aim, float]:
        """Return what to steer by, and the steering."""
        settings, car = self._settings, self._car
        near_m, far_m = path.radius_m[-2:]
        near_rad, far_rad = path.bearing_rad[-2:]
        line_rad, line_error_m = math.nan, math.nan
        if line is not None:
            line_rad, line_error_m = line.heading_rad, line.distance_m - desired_m
        error_m, heading_rad, straight, steering_rad = pursued(
            near_m, near_rad, far_m, far_rad, nearest_m - desired_m, line_rad, line_error_m, self._bend_per_m, bend,
            speed_mps, settings.kp, settings.kd, car.wheelbase_m,
        )  # fmt: skip
        if settings.trim_integral:
            steering_rad -= self._track.trim_rad
        steering_rad = min(max(steering_rad, -car.max_steering_rad), car.max_steering_rad)
        return Aim(error_m, heading_rad, straight), steering_rad

    def _slips(self, aim: Aim, steering_rad: float) -> bool:
        """Whether the floor may not hold the car in its bend away from the wall."""
        turned_away = steering_rad <= -self._car.max_steering_rad
        return turned_away and aim.error_m < -TOO_NEAR_M and aim.heading_rad < 0.0

    def _speed_mps(self, path: BallPath, steering_rad: float, speed_mps: float, mu: float) -> float:
        settings = self._settings
        if not settings.speed_profile:
            return settings.speed_mps
        now_mps = speed_limit_mps(steering_rad, self._car.wheelbase_m, mu)
        ahead_mps = profile_mps(path, speed_mps, mu)
        return min(settings.speed_mps, now_mps, ahead_mps)

    def _moved_m(self, stamp_s: float, speed_mps: float) -> float:
        """Return the way since the last scan."""
        since_s = stamp_s - self._stamp_s
        self._stamp_s = stamp_s
        return speed_mps * since_s if 0.0 < since_s < LONGEST_STEP_S else 0.0

    def _shift(self, scan: Scan, motor: MotorState | None) -> Shift:
        """Return the motion until the answer takes effect: the latency, and the age of a scan that came late."""
        late_s = min(max(scan.received_s - scan.stamp_s, 0.0), LONGEST_STEP_S)
        trim_rad = self._track.trim_rad if self._settings.trim_integral else 0.0
        ahead_s = self._settings.latency_s + late_s
        shift = self._predictor.shift(scan.stamp_s, motor, ahead_s, self._sign * trim_rad)
        return shift if self._sign > 0 else shift.mirrored()

    def _without_wall(self, moved_m: float) -> Guidance:
        drive, reason = self._lost.drive(moved_m)
        if drive is not None:
            drive = Drive(drive.speed_mps, self._sign * drive.steering_rad)
        return Guidance(drive, math.nan, math.nan, math.nan, reason)


def _wall_points(seen: SideView, mine: Beams, line: Line | None, shift: Shift) -> WallPoints:
    """Return my wall as thinned points, panes of glass filled in, as seen from there."""
    glass_m = bridge_glass(seen, mine, line) if line is not None else None
    if glass_m is None:
        return WallPoints(*wall_around(seen.x_m, seen.y_m, mine, shift.x_m, shift.y_m, shift.yaw_rad))
    return WallPoints.of(np.concatenate((outline(seen.x_m, seen.y_m, mine), glass_m)), shift)


def _from_there(line: Line | None, shift: Shift) -> Line | None:
    return line.seen_from(shift.x_m, shift.y_m, shift.yaw_rad) if line is not None else None
