"""Plausibility check of the wheels against the lidar: contradicting sensors stop the car.

Four checks of each pair of scan and motor report, independent of laws and devices:

* Does the lidar measure? A scan repeated bit for bit while the wheels turned 0.3 m is a stored one, not a measurement.
* Does the car move as its wheels say? Over the first 0.3 m, and again after every lost link and every sudden change of
  the view, the scene's motion is compared with the odometry's (`motion_agreement`). Opposite directions: two phases of
  the motor are swapped, and the controller cannot know. Sideways: the lidar is turned on the car. Another scale: the
  gain is wrong.
* Does the scene go on moving as the wheels say? Along the whole drive, see `scene_agreement`.
* Does it move at all? Wheels in the air turn without moving the car. That is no fault, but such odometry cannot be used
  to back out.

Pure and deterministic; slow computations run in `learn`, after the answer is sent.
"""

import math
from collections import deque

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.motion_agreement import Agreement, MotionAgreement
from wallride.runtime.control.perception.perception import Percept
from wallride.runtime.control.perception.scene_agreement import SceneAgreement
from wallride.runtime.control.vehicle import CarSettings

FROZEN_AFTER_M = 0.3
LOST_AFTER_S = 1.0
"""Minimum gap between scans after which the lidar may have been mounted in another way."""
STANDS_FOR_S = 1.0
STANDING_MPS = 0.05
CHANGE_EVERY_RAD = math.radians(2.0)
CHANGE_WINDOW_S = 0.1
"""Time over which a change is sudden; at least from one scan to the next."""
ENOUGH_BEARINGS = 20
CHANGED_RATIO = math.exp(0.35)
"""Ratio of the ranges, of half of the bearings, that no drive of a tenth of a second gives: 40 % nearer or farther."""
FROZEN = "the lidar repeats one scan: power-cycle it, check its cable"
BACKWARDS = "runs backwards: swap two phases of the motor (or is the lidar turned by 180 degrees?)"
TURNED = "the scene moves sideways: the lidar is turned on the car; mount it straight (lidar.yaw_rad), start again"
HELD_OR_TURNED = "the wheels turn and what is ahead stands: free the wheels, mount the lidar straight, start again"
WHEELS_IN_THE_AIR = "the wheels turn and the scan stands (wheels in the air?): it does not back out"
WRONG_SCALE = "the wheels' way is not the scan's: check motor.speed_to_erpm_gain and the lidar's mounting"


_TURNED = {Agreement.ASIDE: TURNED, Agreement.HELD_OR_ASIDE: HELD_OR_TURNED}
_CONTRADICTIONS = {Agreement.OPPOSITE: BACKWARDS, Agreement.FARTHER: WRONG_SCALE}


class Plausibility:
    """Checks every scan once, in order.

    lidar_doubt: reason why the lidar is not trusted, "" while it is. motor_doubt: the same of the odometry, as a fault
    with its remedy; both stop the car. believed: whether a manoeuvre may be measured by the odometry.
    """

    def __init__(self, car: CarSettings) -> None:
        self._samples = b""
        self._changed_at_m: float | None = None
        self._unlearnt: tuple[Percept, bool] | None = None
        self._is_compared = False  # of the unlearnt scan's samples
        self._stood_since_s: float | None = None
        self._confirmed = False
        self._motion = MotionAgreement(car.lidar_m)
        self._lidar_m = car.lidar_m
        self._scene, self._change = SceneAgreement(self._lidar_m), SuddenChange()
        self._frozen = self._turned = ""
        self._learnt_s = math.inf
        self.motor_doubt = ""
        self.believed = True

    @property
    def lidar_doubt(self) -> str:
        """Reason why the lidar must not be believed, "" while it may be."""
        return self._frozen or self._turned or self._scene.doubt

    @property
    def doubt(self) -> str:
        """Reason why the car must stand, "" while the sensors are consistent."""
        return self.lidar_doubt or self.motor_doubt

    @property
    def words(self) -> tuple[str, ...]:
        """Warnings for the user that do not stop the car."""
        return () if self.believed or self.doubt else (WHEELS_IN_THE_AIR,)

    def look(self, percept: Percept, *, odometry_check: bool = True) -> None:
        """Process one scan; odometry_check: whether it and the motor's report belong to one drive."""
        if self._unlearnt is not None:
            self.learn()
        scan, motor = percept.scan, percept.motor
        self._unlearnt, at_m = (percept, odometry_check), self._changed_at_m
        # Before the wheels have turned so far, the comparison decides nothing, and waits for `learn`.
        far = motor is not None and at_m is not None and abs(motor.distance_m - at_m) >= FROZEN_AFTER_M
        self._is_compared = far or self._frozen != ""
        if self._is_compared:
            self._compare(scan, motor)

    def _compare(self, scan: Scan, motor: MotorState | None) -> None:
        """Compare the samples with those of the last scan."""
        samples = scan.ranges_m.tobytes()
        if motor is None or samples != self._samples:
            self._samples, self._frozen = samples, ""
            self._changed_at_m = motor.distance_m if motor is not None else None
        elif self._changed_at_m is None:
            self._changed_at_m = motor.distance_m
        elif abs(motor.distance_m - self._changed_at_m) >= FROZEN_AFTER_M:
            self._frozen = FROZEN

    def learn(self) -> None:
        """Compare the last scan's samples with the one before, and its motion with the odometry's. Idempotent."""
        if self._unlearnt is None:
            return
        (percept, odometry_check), self._unlearnt = self._unlearnt, None
        scan, motor, pose = percept.scan, percept.motor, percept.pose
        if not self._is_compared:
            self._compare(scan, motor)
        if not odometry_check:
            self._forget_drive()
            return
        if scan.stamp_s - self._learnt_s > LOST_AFTER_S:
            self._begin_anew()
        self._learnt_s = scan.stamp_s
        if motor is None:  # after the link returns, the motor may be wired differently
            self.motor_doubt, self.believed = "", True
            self._begin_anew()
            self._scene.forget()
            return
        self._scene.learn(scan, self._samples, pose, motor.distance_m)
        if self._change.learn(scan, pose.yaw_rad) and self._confirmed:
            self._begin_anew()  # the lidar may have been turned; a view that agrees with the wheels again was not
        if self.motor_doubt:
            self._await_standstill(scan, motor)
        elif not (self._confirmed or self._turned):
            self._conclude(self._motion.learn(scan, motor, pose))

    def forget_newest(self) -> None:
        """Learn nothing from the newest scan: it was a rehearsal."""
        self._unlearnt = None

    def _forget_drive(self) -> None:
        """Drop what was compared: with the check off, nothing would ever end a doubt of it."""
        if self._learnt_s < math.inf:
            self.motor_doubt, self.believed, self._learnt_s = "", True, math.inf
            self._begin_anew()
            self._scene = SceneAgreement(self._lidar_m)

    def _begin_anew(self) -> None:
        self._confirmed, self._turned = False, ""
        self._motion.forget()

    def _await_standstill(self, scan: Scan, motor: MotorState) -> None:
        """End the doubt where the car has stood for a while: a latch has taken effect, and the next metres decide."""
        if abs(motor.speed_mps) > STANDING_MPS or self._stood_since_s is None:
            self._stood_since_s = scan.stamp_s
        elif scan.stamp_s - self._stood_since_s >= STANDS_FOR_S:
            self._stood_since_s, self.motor_doubt = None, ""
            self._begin_anew()

    def _conclude(self, found: Agreement) -> None:
        match found:
            case Agreement.AGREES:
                self._confirmed = self.believed = True
            case Agreement.STANDS:
                self.believed = False
                self._motion.forget()
            case Agreement.ASIDE | Agreement.HELD_OR_ASIDE:
                self._turned, self.believed = _TURNED[found], False
            case Agreement.OPPOSITE | Agreement.FARTHER:
                self.motor_doubt, self.believed = _CONTRADICTIONS[found], False


@value(eq=False)
class _Sight:
    """Ranges of every bearing, (k,), NaN without a return, and the heading of the car."""

    stamp_s: float
    kind: tuple[float, float, int]
    range_m: Floats
    step_rad: float
    yaw_rad: float


class SuddenChange:
    """Tells a view that changed at once in all directions, as of a lidar that was knocked, turned or replaced.

    It compares each scan with one shortly before, at the bearings that the car's own turn leaves.
    """

    def __init__(self) -> None:
        self._looks: deque[_Sight] = deque()

    def learn(self, scan: Scan, yaw_rad: float) -> bool:
        """Take in a scan; return whether the view has changed at once."""
        every = max(1, round(CHANGE_EVERY_RAD / scan.angle_step_rad))
        range_m = scan.ranges_m[::every].astype(np.float64)
        range_m[~((range_m > scan.range_min_m) & (range_m < scan.range_max_m))] = np.nan
        kind = (scan.angle_min_rad, scan.angle_step_rad, scan.ranges_m.size)
        now = _Sight(scan.stamp_s, kind, range_m, every * scan.angle_step_rad, yaw_rad)
        looks = self._looks
        while len(looks) > 1 and looks[1].stamp_s <= now.stamp_s - CHANGE_WINDOW_S:
            looks.popleft()
        changed = bool(looks) and _has_changed(looks[0], now)
        if changed:
            looks.clear()
        looks.append(now)
        return changed


def _has_changed(before: _Sight, now: _Sight) -> bool:
    if before.kind != now.kind:
        return True
    turned = round(math.remainder(now.yaw_rad - before.yaw_rad, math.tau) / now.step_rad)
    count = now.range_m.size - abs(turned)
    if count < ENOUGH_BEARINGS:
        return False
    was_m = before.range_m[max(turned, 0) : max(turned, 0) + count]
    is_m = now.range_m[max(-turned, 0) : max(-turned, 0) + count]
    near_m, far_m = np.minimum(was_m, is_m), np.maximum(was_m, is_m)
    changed = np.count_nonzero(far_m > CHANGED_RATIO * near_m)  # NaN is not larger
    seen = np.count_nonzero(near_m > 0.0)
    return bool(ENOUGH_BEARINGS <= seen <= 2 * changed)
