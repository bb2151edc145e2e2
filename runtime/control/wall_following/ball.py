"""Rolling-ball follower: the car steers after a ball that is rolled along the wall.

For each scan: find the followed wall, transform it to the pose at which the answer takes effect (`prediction`), roll a
ball with the desired distance as radius along it (`ball_path`), steer after the ball (`ball_law`), and limit the speed
by its path (`speed_profile`). Beside a straight wall the tracked line (`wall_track`) is more accurate than one scan's
points. Without a wall the follower reports it and acts by the settings (`no_wall_policy`).
Everything between the mirror at the entrance and the one at the exit is for a wall on the left.
"""

import math

import numpy as np

from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.control.guidance import Driver, Guidance
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.noise_bias import FIRST_NOISE_M, learn_noise_m
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.ball_drive import drive_along_ball
from wallride.runtime.control.wall_following.ball_law import Aim, Steered, look_aheads_m
from wallride.runtime.control.wall_following.ball_path import RADII_M, Ball, BallPath, Rollout, roll_path
from wallride.runtime.control.wall_following.ball_settings import BallSettings
from wallride.runtime.control.wall_following.corridor_width import Room
from wallride.runtime.control.wall_following.followed_wall import choose_wall, side_view
from wallride.runtime.control.wall_following.no_wall_policy import SEARCH_PER_M, Lost
from wallride.runtime.control.wall_following.prediction import Predictor, Shift
from wallride.runtime.control.wall_following.speed_profile import mu_with_room
from wallride.runtime.control.wall_following.wall_fit import WallLine
from wallride.runtime.control.wall_following.wall_track import WallTrack

MAX_STEP_S = 0.25
"""Maximum time between two scans; after a longer gap the distance driven since is unknown."""
BEND_LOW_PASS = 0.2
"""Gain of the low-pass filter of the path's curvature, which distinguishes a bent wall from a straight one."""


LANE_SHARE = 0.9
"""Maximum share of the desired distance that half of the width ahead has in a lane."""
MIN_OPPOSITE_M = 0.1
"""Minimum clearance of the path in a lane: a nearer path passes through the obstacle, which is a wall with gaps."""


class BallFollower(Driver):
    """Follows a wall by the rolling ball; `BallSettings` has its parameters."""

    def __init__(self, settings: BallSettings, car: CarSettings, eyes: ViewCache) -> None:
        self._settings = settings
        self._car = car
        self._eyes = eyes
        self._sign = 1.0 if settings.side == "left" else -1.0
        self._predictor = Predictor(car.wheelbase_m, car.steering_rate_radps)
        self._bias_m = 0.0
        self._noise_m = FIRST_NOISE_M
        self._track = WallTrack(car.wheelbase_m)
        self._room = Room()
        self._half_ahead_m = math.inf
        """Half of the width of the narrowest place on the path ahead: the continuation, not a gap in a wall."""
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
        """Path of the ball of the newest scan, (2, k) in base_link; None without a wall. For drawings."""
        if self._path is None:
            return None
        path = self._path.first(len(RADII_M))
        places = zip(path.radius_m, path.bearing_rad, path.crosses, strict=True)
        crossed = [(r * math.cos(b), self._sign * r * math.sin(b)) for r, b, crosses in places if crosses]
        return np.array(crossed, np.float64).reshape(-1, 2).T

    @property
    def trim_rad(self) -> float:
        """Learnt angle at which the wheels stand while the servo stands in the middle, toward the followed wall."""
        return self._track.trim_rad if self._settings.trim_integral else 0.0

    def tune(self, settings: BallSettings) -> None:
        """Change the settings and keep the learnt state, which is mirrored on a change of side."""
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
        wanted_m = settings.desired_distance_m
        ball_m = min(self._room.within_m(wanted_m), self._half_ahead_m)
        wall = choose_wall(seen, ball_m, expected, wanted_m, into_lane=self._half_ahead_m < LANE_SHARE * wanted_m)
        if wall is None:
            self._path = None
            self._half_ahead_m = math.inf
            self._track.correct(None)
            return self._without_wall(moved_m)
        line = wall.line
        tracked = self._track.correct(line)
        desired_m = self._room.beside_m(line, wall.room_m, wanted_m, moved_m)
        look_m = look_aheads_m(settings.look_ahead_m, settings.look_ahead_s, speed_mps)
        self._noise_m = learn_noise_m(self._noise_m, seen.x_m, seen.y_m, wall.beams)
        ball = roll_path(seen, wall, shift, Ball(self._bias_m, self._noise_m, desired_m), look_m)
        self._path, self._bias_m = ball.path, ball.bias_m
        self._half_ahead_m = half_ahead_m(desired_m, ball.opposite_m)
        self._bend_per_m += BEND_LOW_PASS * (ball.bend_per_m - self._bend_per_m)
        error_m, steering_rad, wanted_mps = self._answer(ball, tracked, shift, desired_m, speed_mps)
        self._lost.found(steering_rad)
        drive = Drive(wanted_mps, self._car.steered_rad(self._sign * steering_rad))
        self._predictor.answers.said(scan.received_s, drive.steering_rad)
        angle_rad, line_m = math.nan, math.nan
        if line is not None:
            angle_rad, line_m = self._sign * line.heading_rad, line.distance_m
        return Guidance(drive, error_m + desired_m, error_m, angle_rad, "wall", line_m)

    def _answer(
        self, ball: Rollout, tracked: WallLine | None, shift: Shift, desired_m: float, speed_mps: float
    ) -> tuple[float, float, float]:
        """Return the distance error, the steering and the speed."""
        settings, car = self._settings, self._car
        line_rad, line_error_m = math.nan, math.nan
        if tracked is not None:
            there = tracked.seen_from(shift.x_m, shift.y_m, shift.yaw_rad)
            line_rad, line_error_m = there.heading_rad, there.distance_m - ball.rough_m - desired_m
        nearest_error_m = ball.nearest_m + ball.bias_m - ball.rough_m - desired_m
        room_m = min(desired_m, ball.opposite_m)
        aim = Aim(nearest_error_m, line_rad, line_error_m, self._bend_per_m, speed_mps)
        steered = Steered(settings.kp, settings.kd, car.wheelbase_m, self.trim_rad, car.max_steering_rad)
        mu = mu_with_room(settings.assumed_mu, room_m) if settings.speed_profile else math.inf
        error_m, self._straight, steering_rad, wanted_mps = drive_along_ball(
            ball.path, aim, steered, settings.speed_mps, mu
        )
        return error_m, steering_rad, wanted_mps

    def _moved_m(self, stamp_s: float, speed_mps: float) -> float:
        """Return the distance driven since the last scan."""
        since_s = stamp_s - self._stamp_s
        self._stamp_s = stamp_s
        return speed_mps * since_s if 0.0 < since_s < MAX_STEP_S else 0.0

    def _shift(self, scan: Scan, motor: MotorState | None) -> Shift:
        """Return the motion until the answer takes effect: the latency, and the age of a scan that came late."""
        late_s = min(max(scan.received_s - scan.stamp_s, 0.0), MAX_STEP_S)
        ahead_s = self._settings.latency_s + late_s
        shift = self._predictor.shift(scan.stamp_s, motor, ahead_s, self._sign * self.trim_rad)
        return shift if self._sign > 0 else shift.mirrored()

    def _without_wall(self, moved_m: float) -> Guidance:
        drive, reason = self._lost.drive(moved_m)
        if drive is not None:
            drive = Drive(drive.speed_mps, self._car.steered_rad(self._sign * drive.steering_rad))
        return Guidance(drive, math.nan, math.nan, math.nan, reason)


def half_ahead_m(desired_m: float, opposite_m: float) -> float:
    """Return half of the width ahead, where the path keeps desired_m from the wall; infinity where it is no lane."""
    return (desired_m + opposite_m) / 2 if opposite_m > MIN_OPPOSITE_M else math.inf
