"""The perception stage: what is understood of a scan, once, for every law.

`look` makes a Percept of a scan and of the motor's report; follower, safety, recovery, plausibility and own laws read
it. What the answer does not need is learnt when the answer is on the wire (`learn`), at the latest with the next scan.
Nothing here judges: what a car may do with a percept is the laws' matter.
"""

import math
from collections.abc import Callable

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import NOWHERE, Places
from wallride.runtime.control.perception.lidar_health import LidarHealth
from wallride.runtime.control.perception.lidar_health_settings import LidarHealthSettings
from wallride.runtime.control.perception.motion.own_motion import MatchedOdometry, OwnMotion
from wallride.runtime.control.perception.motion.scan_matching import ScanPose
from wallride.runtime.control.perception.obstacles.moving_obstacles import MovingObstacles
from wallride.runtime.control.perception.obstacles.rear_memory import RearMemory
from wallride.runtime.control.perception.obstacles.thin_obstacles import ThinObstacles
from wallride.runtime.control.perception.odometry import Odometry, OdometryState
from wallride.runtime.control.perception.own_parts import KnownParts, OwnParts
from wallride.runtime.control.perception.scene_motion import SceneMotion
from wallride.runtime.control.perception.sliding_speed import SlidingSpeed
from wallride.runtime.control.perception.view import View, ViewCache
from wallride.runtime.control.perception.visibility.visibility import Visibility
from wallride.runtime.control.tyres import Tyres
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings

KEPT_ANGLES = 64


@value()
class Assumed:
    """What perception assumes of floor, window and tyres; safety's settings say it.

    doubtful_mps: speed that is left while the window is in doubt. slippery_mps2: grip of a slippery floor. mu,
    front_per_rad, rear_per_rad: as those of `Tyres`.
    """

    window: LidarHealthSettings
    doubtful_mps: float
    slippery_mps2: float
    mu: float
    front_per_rad: float
    rear_per_rad: float


@value(eq=False)
class Percept:
    """One scan as it is understood. The trackers are those of the stage: they change with its next scan.

    pose: base_link in odom. told: the motion, computed when it is first asked for. speed_mps: signed, over the ground,
    also while the wheels are locked. wheel_rad: the wheels' angle as reported. slid_s: stamp of the last scan with
    locked wheels, or without a report. past_rad: (stamp, angle of the wheels) at the last scans, this one's last.
    unseen_m: obstacles that the view alone does not show, (k,) in base_link: predicted places of what moves, and thin
    ones. ceiling_mps, ceiling_reason: of the window.
    """

    scan: Scan
    motor: MotorState | None
    view: View
    pose: OdometryState
    told: Callable[[], OwnMotion]
    speed_mps: float
    wheel_rad: float
    slid_s: float
    past_rad: tuple[tuple[float, float], ...]
    unseen_m: Places
    ceiling_mps: float
    ceiling_reason: str
    behind: RearMemory
    movers: MovingObstacles
    visibility: Visibility

    @property
    def motion(self) -> OwnMotion:
        """Return the car's own motion, corrected by scans, which odom is not."""
        return self.told()


class Perception:
    """Understands every scan once, in order.

    views: the view of each scan. health: state of the lidar's window. own_parts: the car's own, in view of its lidar.
    """

    def __init__(self, car: CarSettings, assumed: Assumed) -> None:
        self.car = car
        self.views = ViewCache(car)
        self.odometry = Odometry(car.wheelbase_m)
        self.matched = MatchedOdometry(self._tyres(assumed))
        self.health = LidarHealth(assumed.window, car.wheelbase_m, assumed.doubtful_mps)
        self.scene_motion = SceneMotion(car.lidar_m)
        self.own_parts = OwnParts(car.lidar_m)
        self.behind = RearMemory(car.lidar_m)
        self.movers = MovingObstacles()
        self.thin = ThinObstacles()
        self.visibility = Visibility(car)
        self._speed = SlidingSpeed(GRAVITY_MPS2, assumed.slippery_mps2)
        self._slid_s = self._reported_s = -math.inf
        self._past_rad: tuple[tuple[float, float], ...] = ()
        self._before = self.odometry.pose
        self._last_m: float | None = None
        self._percept: Percept | None = None
        self._learnt = True
        self._deferred: Callable[[], object] | None = None

    def tune(self, assumed: Assumed) -> None:
        """Change what is assumed; the window's dirt and the tracks of moving obstacles are kept."""
        self.learn()
        self.health.tune(assumed.window, assumed.doubtful_mps)
        self._speed.tune(GRAVITY_MPS2, assumed.slippery_mps2)
        self.matched.tyres = self._tyres(assumed)

    def _tyres(self, assumed: Assumed) -> Tyres:
        return Tyres(self.car.wheelbase_m, assumed.mu, assumed.front_per_rad, assumed.rear_per_rad)

    def look(self, scan: Scan, motor: MotorState | None) -> Percept:
        """Understand one scan; asked again for the newest one, return the same percept."""
        if self._percept is not None and self._percept.scan is scan:
            return self._percept
        self.learn()
        view = self.views.see(scan)
        if not self.own_parts.have_met(scan):
            view = self._look_anew(view)
        speed_mps, wheel_rad, step_m = self._read(motor, scan.stamp_s)
        self._before = self.odometry.pose
        pose = self.odometry.update(motor)
        self.behind.move(pose, step_m)
        self.health.glance(view)
        self.visibility.look(view, pose)
        self._past_rad = (
            *self._past_rad[1 - KEPT_ANGLES :],
            (scan.stamp_s, wheel_rad if math.isfinite(wheel_rad) else 0.0),
        )
        lost = motor is None or self._speed.slides
        if lost:
            self._slid_s = scan.stamp_s
        told = self.matched.later(scan.stamp_s, motor)
        movers_m = self.movers.update(view, pose, scan.stamp_s, told, sliding=lost)
        thin_m = self.thin.update(view, pose, scan.stamp_s)
        unseen_m = np.concatenate([movers_m, thin_m]) if movers_m.size or thin_m.size else NOWHERE
        self._learnt = False
        self._percept = Percept(
            scan, motor, view, pose, told, speed_mps, wheel_rad, self._slid_s, self._past_rad, unseen_m,
            self.health.ceiling_mps, self.health.reason, self.behind, self.movers, self.visibility,
        )  # fmt: skip
        return self._percept

    def _read(self, motor: MotorState | None, stamp_s: float) -> tuple[float, float, float]:
        """Return the signed speed, the wheels' angle, and the distance since the last scan."""
        last_m = self._last_m
        if motor is None:
            self._last_m = None
            return self._speed.update(None, stamp_s), 0.0, 0.0
        self._last_m, most_rad = motor.distance_m, self.car.max_steering_rad
        step_m = motor.distance_m - last_m if last_m is not None else 0.0
        speed_mps = self._speed.update(motor.speed_mps, stamp_s, motor.stamp_s - self._reported_s)
        self._reported_s = motor.stamp_s
        return speed_mps, min(max(motor.steering_rad, -most_rad), most_rad), step_m

    def _look_anew(self, view: View) -> View:
        """Return the view of a first scan, doubting every return behind the shoulder except a wall continuing there."""
        self.own_parts.update(view, self.odometry.pose)
        self.views.ignore(self.health.mask, self.own_parts.below_m)
        return self.views.see(view.scan)

    def remember(self, known: KnownParts | None) -> None:
        """Restore these own parts, and reset the state of the window."""
        self.catch_up()
        self.own_parts.remember(known)
        self.health.forget()
        self.views.ignore(None)

    @property
    def newest_view(self) -> View | None:
        """Return the view of the newest scan, None before the first."""
        return self._percept.view if self._percept is not None else None

    def defer(self, work: Callable[[], object]) -> None:
        """Do this before `learn` learns anything: one piece of work for a scan."""
        self._deferred = work

    def catch_up(self) -> None:
        """Do what was deferred, if that is still to do."""
        if (work := self._deferred) is not None:
            self._deferred = None
            work()

    def forget_newest(self) -> None:
        """Learn nothing from the newest scan: it was a rehearsal."""
        self._learnt = True

    def learn(self) -> None:
        """Learn from the last scan what only later ones need: the window's dirt, the memory of the rear, its place.

        Runs after the answer is sent, so that the motor does not wait for it; at the latest with the next scan.
        Idempotent.
        """
        self.catch_up()
        percept = self._percept
        if self._learnt or percept is None:
            return
        self._learnt = True
        view, motor, pose = percept.view, percept.motor, percept.pose
        self.scene_motion.update(view, pose)
        self.own_parts.update(view, pose, moved=False if self._speed.slides else self.scene_motion.moved)
        percept.told()
        self.matched.learn(view, lost=self._speed.slides)
        if self.matched.slid is not None:
            self.behind.slide(_pose_of(self._before).placed(self.matched.slid).seen_from(_pose_of(pose)))
        self.behind.keep(view, self.own_parts.doubtful)
        self.health.update(view, motor, scene_stands=self.scene_motion.stands)
        self.visibility.learn()
        self.views.ignore(self.health.mask, self.own_parts.below_m)


def _pose_of(odometry: OdometryState) -> ScanPose:
    return ScanPose(complex(odometry.x_m, odometry.y_m), odometry.yaw_rad)
