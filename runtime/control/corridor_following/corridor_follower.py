"""The follower `corridor`: a fast way between both borders of the course, without a map, else the wall as `ball` does.

For each scan: the borders of the way on, the kept way with its far part planned anew, its speeds, and steering by
`line_law` at the place where the car will be when the answer takes effect. Where the course divides, it takes the way
that lies first from the followed side, as `ball`, which answers every scan, too, and drives where no way is found.
Everything between the mirror at the entrance and the one at the exit is for a wall on the left.
"""

import cmath
import math
from dataclasses import replace
from typing import Final

import numpy as np

from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.control.corridor_following.borders import returns_of
from wallride.runtime.control.corridor_following.corridor_settings import CorridorFollowSettings
from wallride.runtime.control.corridor_following.kept_way import KeptWay, Way
from wallride.runtime.control.corridor_following.marching import STEP_M, course_of, curvature_of
from wallride.runtime.control.corridor_following.way_speed import WayGrip, way_speeds_mps
from wallride.runtime.control.guidance import Driver, Guidance, Promise
from wallride.runtime.control.line_following import line_law
from wallride.runtime.control.line_following.promising import Return, way_ahead
from wallride.runtime.control.line_following.race_line import CourseLine, OnLine
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.motion.own_motion import DrivenPlace
from wallride.runtime.control.perception.perception import Percept, Perception
from wallride.runtime.control.tyres import Moving, Tyres
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.ball import MAX_STEP_S, BallFollower
from wallride.runtime.control.wall_following.ball_drive import SLIPPING_SHARE
from wallride.runtime.control.wall_following.followed_wall import side_view
from wallride.runtime.control.wall_following.prediction import WIRE_S
from wallride.runtime.control.wall_following.speed_profile import speed_limit_mps

DRIVES: Final = "between the borders"
BY_BALL: Final = "no way between the borders: along the wall"
LEAST_SEEN_M: Final = 0.8
"""Least way that has to be seen ahead; with less the wall is followed."""
RESTS_SCANS: Final = 8
"""For so many scans the wall is followed once there was no way."""
STANDS_MPS, STANDS_S = 0.05, 0.5
WALL_M: Final = 10.0
"""Way along the wall after a standstill: the car would take the same wrong way again, for which safety stopped it, or
the next one: between furniture there are many."""
PROMISED_M, PROMISED_S, PROMISED_MPS2 = 0.5, 0.3, 3.5
"""The promise reaches as far as an early brake of safety, and not into what is not seen: that changes."""
MARGIN_M: Final = 0.08
"""Error aside that a promise admits; what safety measures beyond it counts."""


class CorridorFollower(Driver):
    """Follows the course; `CorridorFollowSettings` has its parameters."""

    def __init__(self, settings: CorridorFollowSettings, car: CarSettings, perception: Perception) -> None:
        self._settings = settings
        self._car = car
        self._perception = perception
        self._ball = BallFollower(settings, car, perception.views)
        self._kept = KeptWay()
        self._here: DrivenPlace | None = None
        self._told = line_law.ToldWheels(car.steering_rate_radps)
        self._slip_rad = 0.0
        self._stamp_s = math.nan
        self._rests = 0
        self._stood_s, self._wall_m = 0.0, 0.0
        self._line: CourseLine | None = None

    def tune(self, settings: CorridorFollowSettings) -> None:
        """Change the settings; the way stays, as long as the side does."""
        self._ball.tune(settings)
        if settings.side != self._settings.side:
            self._kept.forget()
            self._told.mirror()
            self._slip_rad = -self._slip_rad
        self._settings = settings

    @property
    def path_m(self) -> Floats | None:
        """Return the way, or the path of the ball, (2, k) in base_link. For drawings."""
        if self._line is None:
            return self._ball.path_m
        places_m = self._line.places_m
        return np.array([places_m.real, self._side * places_m.imag])

    @property
    def _side(self) -> float:
        return 1.0 if self._settings.side == "left" else -1.0

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan."""
        by_ball = self._ball.follow(scan, motor)
        since_s, self._stamp_s = scan.stamp_s - self._stamp_s, scan.stamp_s
        since_s = since_s if 0.0 < since_s < MAX_STEP_S else 0.0
        self._line = None
        self._stand(motor.speed_mps if motor is not None else 0.0, since_s)
        seen = self._perception.look(scan, motor)
        self._carry(seen, since_s)
        guidance = self._by_way(seen, since_s)
        if guidance is not None:
            guidance = replace(guidance, distance_m=by_ball.distance_m)
        else:
            guidance = replace(by_ball, reason=BY_BALL if by_ball.drive is not None else by_ball.reason)
        told_rad = self._side * guidance.drive.steering_rad if guidance.drive is not None else 0.0
        self._told.tell(told_rad, since_s)
        return guidance

    def _stand(self, speed_mps: float, since_s: float) -> None:
        """Count how long the car stands, and the way that it then follows the wall."""
        self._stood_s = self._stood_s + since_s if abs(speed_mps) < STANDS_MPS else 0.0
        self._wall_m = WALL_M if self._stood_s > STANDS_S else max(0.0, self._wall_m - max(0.0, speed_mps) * since_s)

    def _carry(self, seen: Percept, since_s: float) -> None:
        """Carry the way to this scan. It stays where it is in the odometry's frame: errors corrected since are its."""
        last, self._here = self._here, seen.motion.here
        way = self._kept.way
        if last is None or since_s == 0.0 or seen.slid_s >= seen.scan.stamp_s:
            self._kept.forget()
        elif way is not None:
            moved_m = (self._here.at_m - last.at_m) * last.turn.conjugate()
            moved_m = moved_m if self._side > 0.0 else moved_m.conjugate()
            turned_rad = self._side * cmath.phase(self._here.turn * last.turn.conjugate())
            self._kept.way = way.carried(moved_m, turned_rad)

    def _by_way(self, seen: Percept, since_s: float) -> Guidance | None:
        """Answer by a way between the borders, None where there is none."""
        scan, motor, tyres = seen.scan, seen.motor, self._tyres()
        self._rests = max(0, self._rests - 1)
        if motor is None or self._rests > 0 or self._wall_m > 0.0:
            self._kept.forget()
            return None
        way = self._planned(seen, motor.speed_mps)
        if way is None:
            self._rests = RESTS_SCANS
            self._kept.forget()
            return None
        motion = seen.motion
        now = Moving(0j, 0.0, motor.speed_mps, self._side * motion.here.turn_radps, self._side * motion.trim_rad)
        self._slip_rad = now.slipped_rad(self._slip_rad, since_s, tyres)
        self._line = line = self._line_of(way)
        return self._along(scan, now, line, line.nearest(0j, float(line.along_m[way.here])), tyres, way.seen)

    def _planned(self, seen: Percept, speed_mps: float) -> Way | None:
        """Return the way on, None where none is seen."""
        side = side_view(seen.view, self._settings.side)
        lidar_m = complex(self._car.lidar_x_m, self._side * self._car.lidar_y_m)
        returns = returns_of(side, lidar_m)
        if returns is None or not returns.gaps:
            return None
        way = self._kept.plan(returns, speed_mps)
        return way if way is not None and STEP_M * (way.seen - way.here) >= LEAST_SEEN_M else None

    def _line_of(self, way: Way) -> CourseLine:
        """Return a way as a line with its speeds. It does not close; what reads it ends before its last point."""
        settings, places_m = self._settings, way.places_m
        curvature = curvature_of(places_m)
        along_m = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(places_m)))])
        grip = WayGrip.of(settings.assumed_mu, settings.speed_mps)
        speeds_mps = np.array(way_speeds_mps(curvature, STEP_M, way.seen, grip))
        length_m = float(along_m[-1]) + STEP_M
        return CourseLine(places_m, along_m, np.angle(course_of(places_m)), curvature, speeds_mps, length_m)

    def _along(self, scan: Scan, now: Moving, line: CourseLine, on: OnLine, tyres: Tyres, seen: int) -> Guidance:
        """Answer by the way."""
        late_s = min(max(scan.received_s - scan.stamp_s, 0.0), MAX_STEP_S)
        then = self._told.ahead(now, self._settings.latency_s + WIRE_S + late_s, tyres)
        there = line.nearest(then.place_m, on.along_m)
        asked_rad = line_law.steering_rad(then, line, there, tyres)
        steering_rad = self._side * self._car.steered_rad(self._side * asked_rad)
        speed_mps = min(
            line_law.speed_mps(then, line, there), self._settings.speed_mps,
            self._by_grip_mps(now, steering_rad, wide=abs(asked_rad) > abs(steering_rad)),
        )  # fmt: skip
        heading_rad = -line_law.heading_error_rad(now, on, tyres)
        return Guidance(
            Drive(speed_mps, self._side * steering_rad), math.nan, math.nan, self._side * heading_rad,
            DRIVES, promise=self._promise(scan.stamp_s, now, line, on, tyres, seen),
        )  # fmt: skip

    def _by_grip_mps(self, now: Moving, steering_rad: float, *, wide: bool) -> float:
        """Return the speed that the grip leaves for this steering, which may correct an error beside the way's bend.

        wide: the car runs wide at the end of its steering, and tyres that slip less turn it more.
        """
        mu, wheelbase_m = self._settings.assumed_mu, self._car.wheelbase_m
        if wide:
            mu *= SLIPPING_SHARE
        most_mps = speed_limit_mps(steering_rad + now.trim_rad, wheelbase_m, mu)
        used = (now.speed_mps / most_mps) ** 2
        return min(most_mps, line_law.gained_mps(now.speed_mps, used, self._car.max_acceleration_mps2))

    def _promise(self, stamp_s: float, now: Moving, line: CourseLine, on: OnLine, tyres: Tyres, seen: int) -> Promise:
        """Return the way back to the way and along it."""
        most_radpm = tyres.most_radpm(now.speed_mps)
        back = Return.of(on, -self._slip_rad, line_law.feedback_per_m(now.speed_mps, tyres), most_radpm)
        needed_m = PROMISED_M + PROMISED_S * now.speed_mps + now.speed_mps**2 / (2.0 * PROMISED_MPS2)
        most_m = min(needed_m, float(line.along_m[min(seen, line.along_m.size - 1)]) - on.along_m)
        places, speeds_mps = way_ahead(line, back, (0j, 0.0), now.speed_mps, most_m)
        return Promise(np.array([places.real, self._side * places.imag]), speeds_mps, MARGIN_M, stamp_s)

    def _tyres(self) -> Tyres:
        settings = self._settings
        return Tyres(
            self._car.wheelbase_m, settings.assumed_mu, settings.cornering_front_per_rad,
            settings.cornering_rear_per_rad,
        )  # fmt: skip
