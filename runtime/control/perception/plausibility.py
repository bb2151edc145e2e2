"""Plausibility check of the wheels against the lidar: contradicting sensors stop the car.

Four checks of each pair of scan and motor report, independent of laws and devices:

* Does the lidar measure? A scan repeated bit for bit while the wheels turned 0.3 m is a stored one, not a measurement.
* Does the car move as its wheels say? Over the first 0.3 m, and again after every lost link, the scan's own motion is
  compared with the odometry (`scan_shift`). Opposite directions: two phases of the motor are swapped, and the
  controller cannot know. Another scale: the gain is wrong.
* Does the scene go on moving as the wheels say? Along the whole drive, see `scene_agreement`.
* Does it move at all? Wheels in the air turn without moving the car. That is no fault, but such odometry cannot be used
  to back out.

Pure and deterministic; slow computations run in `learn`, after the answer is sent.
"""

import math
from dataclasses import dataclass

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.perception.odometry import Odometry, OdometryState
from wallride.runtime.control.perception.scan_shift import Agreement, compare_shift
from wallride.runtime.control.perception.scene_agreement import SceneAgreement
from wallride.runtime.control.vehicle import CarSettings

FROZEN_AFTER_M = 0.3
CHECKED_OVER_M = 0.3
CHECK_WITHIN_S = 5.0
"""Maximum duration of one check; a slower start is measured anew, because the surroundings change."""
WITNESSES = 2
"""Minimum number of consecutive scans that must contradict the odometry."""
STANDS_FOR_S = 1.0
STANDING_MPS = 0.05
FROZEN = "the lidar repeats one scan: power-cycle it, check its cable"
BACKWARDS = "runs backwards: swap two phases of the motor"
WHEELS_IN_THE_AIR = "the wheels turn and the scan stands (wheels in the air?): it does not back out"
WRONG_SCALE = "the wheels' way is not the scan's: check motor.speed_to_erpm_gain and the lidar's mounting"


@dataclass(frozen=True, slots=True)
class _Start:
    """Start of the distance being checked."""

    scan: Scan
    distance_m: float
    pose: OdometryState


class Plausibility:
    """Checks every scan once, in order.

    lidar_doubt: reason why the lidar is not trusted, "" while it is. motor_doubt: the same of the odometry, as a fault
    with its remedy; both stop the car. believed: whether a manoeuvre may be measured by the odometry.
    """

    def __init__(self, car: CarSettings) -> None:
        self._car = car
        self._odometry = Odometry(car.wheelbase_m)
        self._samples = b""
        self._changed_at_m: float | None = None
        self._unlearnt: tuple[Scan, MotorState | None, bool] | None = None
        self._is_compared = False  # of the unlearnt scan's samples
        self._stood_since_s: float | None = None
        self._witnesses = 0
        self._confirmed = False
        self._start: _Start | None = None
        self._scene = SceneAgreement(car.lidar_m)
        self._frozen = ""
        self.motor_doubt = ""
        self.believed = True

    @property
    def lidar_doubt(self) -> str:
        """Reason why the lidar must not be believed, "" while it may be."""
        return self._frozen or self._scene.doubt

    @property
    def doubt(self) -> str:
        """Reason why the car must stand, "" while the sensors are consistent."""
        return self.lidar_doubt or self.motor_doubt

    @property
    def words(self) -> tuple[str, ...]:
        """Warnings for the user that do not stop the car."""
        return () if self.believed or self.doubt else (WHEELS_IN_THE_AIR,)

    def look(self, scan: Scan, motor: MotorState | None, *, odometry_check: bool = True) -> None:
        """Process one scan and the newest motor report; odometry_check: whether the two belong to one drive."""
        if self._unlearnt is not None:
            self.learn()
        self._unlearnt, at_m = (scan, motor, odometry_check), self._changed_at_m
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
        (scan, motor, odometry_check), self._unlearnt = self._unlearnt, None
        if not self._is_compared:
            self._compare(scan, motor)
        if not odometry_check:
            return
        pose = self._odometry.update(motor)
        if motor is None:  # after the link returns, the motor may be wired differently
            self.motor_doubt, self.believed = "", True
            self._begin_anew()
            self._scene.forget()
            return
        self._scene.learn(scan, self._samples, pose, motor.distance_m)
        if self.motor_doubt:
            self._await_standstill(scan, motor)
        elif not self._confirmed:
            self._check(scan, motor, pose)

    def _begin_anew(self) -> None:
        self._confirmed, self._start, self._witnesses = False, None, 0

    def _await_standstill(self, scan: Scan, motor: MotorState) -> None:
        """End the doubt where the car has stood for a while: a latch has taken effect, and the next metres decide."""
        if abs(motor.speed_mps) > STANDING_MPS or self._stood_since_s is None:
            self._stood_since_s = scan.stamp_s
        elif scan.stamp_s - self._stood_since_s >= STANDS_FOR_S:
            self._stood_since_s, self.motor_doubt = None, ""
            self._begin_anew()

    def _check(self, scan: Scan, motor: MotorState, pose: OdometryState) -> None:
        start = self._start
        stands = abs(motor.speed_mps) <= STANDING_MPS
        if start is None or stands or scan.stamp_s - start.scan.stamp_s > CHECK_WITHIN_S:
            self._start = _Start(scan, motor.distance_m, pose)
        elif abs(motor.distance_m - start.distance_m) >= CHECKED_OVER_M + 0.1 * self._witnesses:
            self._conclude(compare_shift(start.scan, scan, _moved(start.pose, pose), self._car.lidar_m))

    def _conclude(self, found: Agreement) -> None:
        match found:
            case Agreement.AGREES:
                self._confirmed = self.believed = True
            case Agreement.STANDS:
                self.believed, self._start = False, None
            case Agreement.UNKNOWN:
                self._start = None
            case _:
                self._witnesses += 1
                if self._witnesses < WITNESSES:
                    return
                self.motor_doubt = BACKWARDS if found is Agreement.OPPOSITE else WRONG_SCALE
                self.believed = False
        self._witnesses = 0


def _moved(start: OdometryState, end: OdometryState) -> tuple[float, float, float]:
    """Return the shift x_m, y_m, yaw_rad of base_link from one pose to another, in the frame of the first."""
    dx, dy = end.x_m - start.x_m, end.y_m - start.y_m
    cos, sin = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
    return cos * dx + sin * dy, cos * dy - sin * dx, math.remainder(end.yaw_rad - start.yaw_rad, math.tau)
