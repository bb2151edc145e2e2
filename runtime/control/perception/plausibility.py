"""Plausibility check of the wheels against the lidar: contradicting sensors stop the car.

Independent of laws and devices, for each pair of scan and motor report:

* Does the lidar measure? Scans of the last ten seconds that come again bit for bit, one of them or a loop of many,
  while the wheels turned 0.3 m, are stored ones, not measurements.
* Does the scene move as the wheels say? All along the drive, each scan is compared with one taken a quarter metre back
  (`scene_agreement`). A scene that stands, jumps back or moves another way is told by a lidar that repeats itself, is
  covered or turned, or by wheels that are not on the floor: nothing on the car knows which. Before the first agreement,
  and after every lost link, the opposite direction means two phases of the motor, and another scale its gain.

Pure and deterministic; slow computations run in `learn`, after the answer is sent.
"""

import math
from collections import deque

from drivers.api import MotorState, Scan
from runtime.control.perception.odometry import Odometry
from runtime.control.perception.scan_shift import Agreement
from runtime.control.perception.scene_agreement import SceneAgreement
from runtime.control.vehicle import CarSettings

FROZEN_AFTER_M = 0.3
REMEMBERS_SCANS = 400
WITNESSES = 2
"""Number of comparisons that must contradict the odometry, without one between them that agrees."""
AGREES_AGAIN = 16
"""Number of comparisons in a row, over about a metre, after which a lidar is trusted again."""
RESTARTED_AFTER_S = 1.0
"""Minimum gap between two scans of a lidar that was restarted."""
STANDS_FOR_S = 1.0
STANDING_MPS = 0.05
FROZEN = "the lidar repeats its scans: power-cycle it, check its cable"
BACKWARDS = "runs backwards: swap two phases of the motor"
STANDS = "the wheels turn and the scan does not move with them: uncover and power-cycle the lidar, wheels on the floor"
TURNED = "the scan moves another way than the wheels: check how the lidar is mounted, lidar.yaw_rad, and power-cycle it"
WRONG_SCALE = "the wheels' way is not the scan's: check motor.speed_to_erpm_gain and the lidar's mounting"


class Plausibility:
    """Checks every scan once, in order.

    lidar_doubt: reason why the lidar is not trusted, "" while it is. motor_doubt: the same of the odometry, as a fault
    with its remedy; both stop the car. believed: whether a manoeuvre may be measured by the odometry.
    """

    def __init__(self, car: CarSettings) -> None:
        self._odometry = Odometry(car.wheelbase_m)
        self._scene = SceneAgreement(car.lidar_m)
        self._order: deque[int] = deque()
        self._seen: set[int] = set()
        self._repeats = False
        self._changed_at_m: float | None = None
        self._unlearnt: tuple[Scan, MotorState | None, bool] | None = None
        self._is_compared = False  # of the unlearnt scan's samples
        self._stood_since_s: float | None = None
        self._stamp_s = math.nan
        self._contradicts = 0
        self._agrees = 0
        self._confirmed = False
        self._frozen = ""
        self._contradiction = ""
        self.motor_doubt = ""
        self.believed = True

    @property
    def lidar_doubt(self) -> str:
        """Reason why the lidar is not trusted, "" while it is."""
        return self._frozen or self._contradiction

    @property
    def doubt(self) -> str:
        """Reason why the car must stand, "" while the sensors are consistent."""
        return self.lidar_doubt or self.motor_doubt

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
        """Compare the samples with those of the last scans."""
        samples = hash(scan.ranges_m.tobytes())
        self._repeats = samples in self._seen
        if not self._repeats:
            if len(self._order) == REMEMBERS_SCANS:
                self._seen.discard(self._order.popleft())
            self._order.append(samples)
            self._seen.add(samples)
        if motor is None or not self._repeats:
            self._frozen = ""
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
        if motor is None:  # after the link returns, the motor may be wired differently
            self.motor_doubt, self.believed = "", True
            self._begin_anew()
        elif self.motor_doubt:
            self._await_standstill(scan, motor)
        else:
            self._check(scan, motor)

    def _begin_anew(self) -> None:
        self._confirmed, self._contradicts, self._contradiction = False, 0, ""
        self._scene.forget()
        self._odometry.update(None)

    def _await_standstill(self, scan: Scan, motor: MotorState) -> None:
        """End the doubt where the car has stood for a while: a latch has taken effect, and the next metres decide."""
        if abs(motor.speed_mps) > STANDING_MPS or self._stood_since_s is None:
            self._stood_since_s = scan.stamp_s
        elif scan.stamp_s - self._stood_since_s >= STANDS_FOR_S:
            self._stood_since_s, self.motor_doubt = None, ""
            self._begin_anew()

    def _check(self, scan: Scan, motor: MotorState) -> None:
        pose, gap_s = self._odometry.update(motor), scan.stamp_s - self._stamp_s
        self._stamp_s = scan.stamp_s
        if gap_s < 0.0 or gap_s > RESTARTED_AFTER_S:
            self._scene.forget()
            self._contradicts, self._contradiction = 0, ""
        found = self._scene.learn(scan, pose, confirmed=self._confirmed) if not self._repeats else None
        if found is not None and found is not Agreement.UNKNOWN:
            self._conclude(found)

    def _conclude(self, found: Agreement) -> None:
        if found is Agreement.AGREES:
            self._contradicts, self._agrees = 0, self._agrees + 1
            self._confirmed = self.believed = self._contradiction == "" or self._agrees >= AGREES_AGAIN
            if self.believed:
                self._contradiction = ""
            return
        if found is Agreement.FARTHER and self._confirmed:  # locked wheels slide
            return
        self._agrees, self._contradicts = 0, self._contradicts + 1
        if found is Agreement.STANDS:
            self.believed = False
        if self._contradicts < WITNESSES:
            return
        self.believed = False
        if not self._confirmed and found in {Agreement.OPPOSITE, Agreement.FARTHER}:
            self.motor_doubt = BACKWARDS if found is Agreement.OPPOSITE else WRONG_SCALE
        else:
            self._contradiction = TURNED if found is Agreement.TURNED else STANDS
