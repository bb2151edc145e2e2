"""The follower `line`: drives the race line of a map where the pose is known, else the wall as `ball` does.

For each scan: the pose, the car as it will be when the answer takes effect, the nearest point of the line there, and
steering and speed by `line_law`. It comes to the line from the wall's path, slowly and only over known free ground.
Where the line goes the other way, as after a hard stop that has turned the car, it says whereto, and recovery turns it.
The ball follows the wall at every scan, too, so that it knows it already when it is needed: where the line is driven,
after the answer.
"""

import cmath
import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any, Final

import numpy as np

from wallride.drivers.api import Drive, MotorState, Scan
from wallride.runtime.control.guidance import Driver, Guidance, Promise
from wallride.runtime.control.line_following import line_law
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.line_following.joining import way_is_free
from wallride.runtime.control.line_following.lap_correction import AT_END_RAD, AT_GRIP, AT_SPEED, LapCorrection
from wallride.runtime.control.line_following.lap_memory import BuildUp, HeldBack, LapMemory
from wallride.runtime.control.line_following.line_settings import LineFollowSettings
from wallride.runtime.control.line_following.observed_slip import ObservedSlip
from wallride.runtime.control.line_following.promising import Promises, Return, way_ahead
from wallride.runtime.control.line_following.race_line import CourseLine, OnLine
from wallride.runtime.control.localization.localizer import PoseEstimate, Whereabouts
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.motion.trim import SteeringTrim
from wallride.runtime.control.perception.perception import Perception
from wallride.runtime.control.tyres import Moving, Tyres, eased_mps
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings
from wallride.runtime.control.wall_following.ball import MAX_STEP_S, BallFollower
from wallride.runtime.control.wall_following.prediction import WIRE_S

NO_LINE: Final = "no race line: along the wall"
UNKNOWN: Final = "the pose is not known: along the wall"
WRONG_WAY: Final = "the race line goes the other way: along the wall"
BLOCKED: Final = "no free way to the race line: along the wall"
STOPPED: Final = "the pose is not known"
JOINS: Final = "joining the race line"
DRIVES: Final = "race line"
JOINED_M, JOINED_RAD = 0.25, 0.35
"""Lateral and heading errors below which the line is joined; beyond the first one the car slows down."""
LINE_SHARE: Final = 0.8
"""Share of the grip up to which the line's bends may need it, where less is observed than `floor_mu`."""
GRIP_USED: Final = 0.9
"""Share of the grip that a bend and the way to gain speed in it may need; the rest is for the feedback."""
DRIVE_SHARE: Final = 0.6
"""Share of the grip to gain speed with on a straight, as lines are planned."""
BELIEVED_S, BELIEVED_M = 0.55, 1.1
"""Time and way on the line until safety believes the promised path (`safety/promise_record.py`, with a scan to spare):
before, it judges the arc, which meets the wall at the speed of the line."""
LEFT_M, LEFT_RAD = 0.8, 1.0
"""Errors above which it has left the line. With a larger heading error it is turned to the line before it joins."""
DRAWN_M, DRAWN_STEP_M = 4.0, 0.2


class LineFollower(Driver):
    """Follows the line of a course. course: None for a car without a map."""

    def __init__(
        self, settings: LineFollowSettings, car: CarSettings, perception: Perception, course: RaceCourse | None
    ) -> None:
        self._settings = settings
        self._car = car
        self._perception = perception
        self._course = course
        self._wall = BallFollower(_of_wall(settings), car, perception.views)
        line = self._line
        self._laps = LapMemory(line.length_m if line is not None else math.inf)
        self._correction = LapCorrection(line) if line is not None else None
        self._line_mps2 = line.aside_mps2 if line is not None else 0.0
        self._build_up = BuildUp(settings.first_lap_share, settings.faster_each_lap)
        self._held = HeldBack(car.max_acceleration_mps2)
        self._trim = SteeringTrim()
        self._promises = Promises()
        self._told = line_law.ToldWheels(car.steering_rate_radps)
        self._slip = ObservedSlip()
        self._slip_rad = 0.0
        self._stamp_s = math.nan
        self._on: OnLine | None = None
        self._joined = False
        self._on_line_s, self._on_line_m = 0.0, 0.0
        self._pose: PoseEstimate | None = None

    def tune(self, settings: LineFollowSettings) -> None:
        """Change the settings; laps, trim and the reached share stay."""
        self._perception.catch_up()
        self._settings = settings
        self._wall.tune(_of_wall(settings))
        self._build_up.tune(settings.first_lap_share, settings.faster_each_lap)

    @property
    def path_m(self) -> Floats | None:
        """Return the line ahead, or the path of the ball, (2, k) in base_link. For drawings."""
        on, pose, line = self._on, self._pose, self._line
        if on is None or pose is None or line is None:
            return self._wall.path_m
        ways_m = on.along_m + np.arange(0.0, DRAWN_M, DRAWN_STEP_M)
        places = np.array([line.place_at(float(way_m)) for way_m in ways_m])
        seen = (places - complex(pose.x_m, pose.y_m)) * cmath.exp(-1j * pose.yaw_rad)
        return np.array([seen.real, seen.imag])

    @property
    def figures(self) -> Mapping[str, Any]:
        """Return laps, the last one's errors, when this one began, and its share of the line's speed."""
        return {**asdict(self._laps.last), "began_s": self._laps.since_s, "speed_share": self._build_up.share}

    @property
    def _line(self) -> CourseLine | None:
        return self._course.line if self._course is not None else None

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan."""
        self._perception.catch_up()
        since_s, self._stamp_s = scan.stamp_s - self._stamp_s, scan.stamp_s
        since_s = since_s if 0.0 < since_s < MAX_STEP_S else 0.0
        if motor is not None and self._held.tells(motor.speed_mps, since_s) and self._joined:
            self._build_up.slower()
            self._promises.held_back()
        guidance = self._eased(self._by_line(scan, motor, since_s), motor)
        drive = guidance.drive if guidance.drive is not None else Drive(0.0, 0.0)
        self._held.asks(drive.speed_mps)
        self._told.tell(drive.steering_rad, since_s)
        return guidance

    def _eased(self, guidance: Guidance, motor: MotorState | None) -> Guidance:
        """Slow down in a bend by no more than it leaves of the grip, also where the pose was lost in it."""
        pose, drive = self._pose, guidance.drive
        if pose is None or motor is None or drive is None or not 0.0 < drive.speed_mps < motor.speed_mps:
            return guidance
        tyres, speed_mps = self._tyres(), motor.speed_mps * pose.scale
        turn_radps = pose.turn_radps
        if math.isnan(turn_radps):
            turn_radps = tyres.turn_radps(self._told.rad + self._trim.rad, speed_mps, 0.0)
        least_mps = eased_mps(speed_mps, speed_mps * turn_radps, tyres.mu * GRAVITY_MPS2) / pose.scale
        return replace(guidance, drive=Drive(max(drive.speed_mps, least_mps), drive.steering_rad))

    def _by_line(self, scan: Scan, motor: MotorState | None, since_s: float) -> Guidance:
        course, line = self._course, self._line
        if course is None or line is None:
            return self._by_wall(scan, motor, NO_LINE)
        self._pose = pose = course.localizer.take(scan, motor)
        if motor is None or pose.whereabouts is not Whereabouts.LOCATED:
            if self._settings.without_pose == "stop":
                return replace(self._by_wall(scan, motor, STOPPED), drive=None)
            return self._by_wall(scan, motor, UNKNOWN)
        assumed = self._tyres()
        now = Moving(
            complex(pose.x_m, pose.y_m), pose.yaw_rad, motor.speed_mps * pose.scale, pose.turn_radps, self._trim.rad
        )
        tyres = assumed.slipping(pose.slip_s2pm)
        self._bound_by_grip(assumed, self._slip.take(now, since_s, assumed, pose.slip_s2pm))
        self._trim.learn(now, motor.steering_rad, since_s, tyres)
        self._on_line_s += since_s
        self._on_line_m += now.speed_mps * since_s
        if reason := self._unfit(now, line, course, tyres):
            guidance = self._by_wall(scan, motor, reason)
            if reason is not WRONG_WAY:
                return guidance
            toward_rad = line.nearest(now.place_m).yaw_rad - now.yaw_rad
            return replace(guidance, toward_rad=math.remainder(toward_rad, math.tau))
        self._perception.defer(lambda: self._wall.follow(scan, motor))
        guidance = self._along(scan, now, line, tyres, pose.scale)
        return replace(guidance, promise=self._promise(scan.stamp_s, since_s, now, line, tyres, pose.scale))

    def _bound_by_grip(self, assumed: Tyres, slip_s2pm: float) -> None:
        """Drive a smaller share of the line's speed where the floor has less grip than assumed."""
        observed_mu = assumed.floor_mu(slip_s2pm)
        known = observed_mu < assumed.mu and self._line_mps2 > 0.0
        most = math.sqrt(LINE_SHARE * observed_mu * GRAVITY_MPS2 / self._line_mps2) if known else math.inf
        self._build_up.bound(most)

    def _promise(
        self, stamp_s: float, since_s: float, now: Moving, line: CourseLine, tyres: Tyres, scale: float
    ) -> Promise | None:
        """Return the way back to the line and along it; none while it joins."""
        self._slip_rad = now.slipped_rad(self._slip_rad, since_s, tyres)
        on = self._on
        if on is None or not self._joined:
            self._promises.begin()
            return None
        course_rad = now.yaw_rad - self._slip_rad
        most_radpm = tyres.most_radpm(now.speed_mps)
        back = Return.of(on, course_rad, line_law.feedback_per_m(now.speed_mps, tyres), most_radpm)
        self._promises.check(back, line.length_m, since_s)
        places, speeds_mps = way_ahead(line, back, (now.place_m, now.yaw_rad), now.speed_mps)
        path_m = np.array([places.real, places.imag])
        return Promise(path_m, self._build_up.share * speeds_mps / scale, self._promises.margin_m, stamp_s)

    def _unfit(self, now: Moving, line: CourseLine, course: RaceCourse, tyres: Tyres) -> str:
        """Note where the car is on the line; return why it cannot drive it, "" where it can."""
        on = line.nearest(now.place_m, self._on.along_m if self._on is not None else math.nan)
        off_rad = abs(line_law.heading_error_rad(now, on, tyres))
        if self._joined:
            self._joined = abs(on.aside_m) < LEFT_M and off_rad < LEFT_RAD
            if not self._joined:
                on = line.nearest(now.place_m)
                off_rad = abs(line_law.heading_error_rad(now, on, tyres))
        if not self._joined:
            if abs(on.aside_m) > JOINED_M and not way_is_free(course.field, line, now.place_m, on):
                return BLOCKED  # first: the lane behind a wall may well go the other way
            if off_rad > LEFT_RAD:
                return WRONG_WAY
            self._joined = abs(on.aside_m) < JOINED_M and off_rad < JOINED_RAD
            self._on_line_s, self._on_line_m = 0.0, 0.0
            self._laps.begin()
        self._on = on
        return ""

    def _along(self, scan: Scan, now: Moving, line: CourseLine, tyres: Tyres, scale: float) -> Guidance:
        """Answer by the line."""
        on = self._on
        assert on is not None  # noqa: S101 - `_unfit` has noted it
        if self._joined:
            self._note(scan.stamp_s, now, line, on)
        share = self._build_up.share
        late_s = min(max(scan.received_s - scan.stamp_s, 0.0), MAX_STEP_S)
        then = self._told.ahead(now, self._settings.latency_s + WIRE_S + late_s, tyres)
        there = line.nearest(then.place_m, on.along_m)
        pulled = tyres.pulling(share**2 * line.pull_at(there.along_m))
        aim_m = self._correction.aim_m(there.along_m, share) if self._correction is not None else 0.0
        aimed = replace(there, aside_m=there.aside_m - aim_m)
        steering_rad = self._car.steered_rad(line_law.steering_rad(then, line, aimed, tyres, pulled))
        speed_mps = min(share * line_law.speed_mps(then, line, there), self._by_grip_mps(now, on, tyres))
        believed = self._joined and self._on_line_s >= BELIEVED_S and self._on_line_m >= BELIEVED_M
        far = max(0.0, (abs(there.aside_m) - JOINED_M) / (LEFT_M - JOINED_M)) if believed else 1.0
        if far > 0.0:
            speed_mps = min(speed_mps, max(self._settings.join_mps, (1.0 - far) * speed_mps))
        speed_mps = min(speed_mps, self._settings.speed_mps) / scale
        heading_rad = -line_law.heading_error_rad(now, on, tyres)
        reason = DRIVES if self._joined else JOINS
        return Guidance(Drive(speed_mps, steering_rad), math.nan, on.aside_m, heading_rad, reason)

    def _by_grip_mps(self, now: Moving, on: OnLine, tyres: Tyres) -> float:
        """Return the speed that the bend leaves grip to gain: a share that rises in it, or a car that was held back."""
        grip_mps2 = tyres.mu * GRAVITY_MPS2
        aside_mps2 = now.speed_mps * max(abs(now.turn_radps), now.speed_mps * abs(on.curvature_radpm))
        gains_mps2 = min(self._car.max_acceleration_mps2, DRIVE_SHARE * grip_mps2)
        speed_mps = max(now.speed_mps, self._settings.join_mps)
        return line_law.gained_mps(speed_mps, aside_mps2 / (GRIP_USED * grip_mps2), gains_mps2)

    def _note(self, stamp_s: float, now: Moving, line: CourseLine, on: OnLine) -> None:
        """Take in where a car that has joined the line is on it."""
        share = self._build_up.share
        if self._correction is not None and self._teaches(now, line, on):
            self._correction.take(on.along_m, on.aside_m, share)
        if self._laps.take(stamp_s, on.along_m, on.aside_m):
            self._build_up.lap_done()
            if self._correction is not None:
                self._correction.lap_done()

    def _teaches(self, now: Moving, line: CourseLine, on: OnLine) -> bool:
        """Whether the error of a car is one that aiming beside the line takes out: at speed, with steering and grip."""
        right_rad, left_rad = self._car.steering_ends_rad
        steers = right_rad + AT_END_RAD < self._told.rad < left_rad - AT_END_RAD
        grips = abs(now.speed_mps * now.turn_radps) < AT_GRIP * self._settings.floor_mu * GRAVITY_MPS2
        return steers and grips and now.speed_mps > AT_SPEED * self._build_up.share * line.speed_at(on.along_m)

    def _by_wall(self, scan: Scan, motor: MotorState | None, reason: str) -> Guidance:
        """Follow the wall, and say why; its distance is no error from the line."""
        self._joined, self._on = False, None
        self._laps.begin()
        guidance = self._wall.follow(scan, motor)
        return replace(guidance, reason=reason if guidance.drive is not None else guidance.reason, error_m=math.nan)

    def _tyres(self) -> Tyres:
        settings = self._settings
        return Tyres(
            self._car.wheelbase_m, settings.floor_mu, settings.cornering_front_per_rad, settings.cornering_rear_per_rad
        )


def _of_wall(settings: LineFollowSettings) -> LineFollowSettings:
    """Return the settings by which the ball drives."""
    return settings.model_copy(update={"speed_mps": settings.wall_speed_mps})
