"""Agreement of the scene's motion with the wheels' motion, in way and direction, collected over several windows.

Per WINDOW_M of the wheels the scans' own displacement is compared with that of the odometry. Two numbers explain the
difference: by how much the wheels' way has to be multiplied (1 for wheels that tell the truth, 0 for wheels in the air,
-1 for a car that drives backwards, 3 for a gain of a third), and by which angle the lidar is turned on the car. A
window determines them only across the walls that it sees, so the sums of squares of all windows are kept, and an answer
is one that fits clearly better than all others.

A car that slides tells nothing: windows count below ROLLS_MPS only, and not after a drop of the wheels' speed that no
tyre can follow, which is one that locks them.
"""

import cmath
import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.scan_displacement import Displacement, Patches, displacement, patches_of

WINDOW_M, WINDOW_RAD, WINDOW_S = 0.08, 0.15, 1.0
"""Minimum way or turn of a window, and its maximum duration."""
ENOUGH_WINDOWS = 3
MEMORY = 0.95
"""Weight of the windows before, at each new one."""
WAY_SHARE, WAY_M = 0.08, 0.004
"""Standard deviation of a window: slip, times of the reports, and walls that are not flat."""
CLEARER, ALIKE = 25.0, 4.0
"""Minimum difference of the sums of squares, in variances, by which every other answer must fit worse, and the maximum
one of two answers that cannot be told apart."""
SURELY_FARTHER = 100.0
"""The same of a way that is farther than the wheels': a slow lidar's scans are bent by turns of the car, which may look
like one way too long; a gain that is wrong gives more in one window."""
CLEARER_OF_SLOW = 60.0
"""As CLEARER, by which true wheels must fit worse, of a lidar whose driver takes the car's motion out of its scans:
what is left of it between parallel walls has looked like a standing or an opposite way by 27 and 42."""
ROLLS_MPS = 2.0
"""Maximum speed at which no car slides sideways: its tightest bend takes less than a grip of 0.45."""
GRIP_MPS2 = 6.0
"""Maximum deceleration of wheels that roll; a full brake that locks them has more."""
HOLDS_AFTER_S = 0.3
STANDING_MPS = 0.05
ASKEW_DEG = (0.0, 7.5, 15.0)
"""Angles of a car that slides, or a lidar that is mounted askew."""
ASIDE_DEG = tuple(7.5 * step for step in range(5, 20))
BEHIND_DEG = (150.0, 157.5, 165.0, 172.5, 180.0)
ROLLED = (0.6, 0.7, 0.8, 0.9, 1.0, 1.15, 1.3, 1.5)


class Agreement(Enum):
    """How the scene moves, by the wheels. HELD_OR_ASIDE: what is seen ahead stands, and nothing else is seen."""

    AGREES = "agrees"
    STANDS = "stands"
    OPPOSITE = "opposite"
    FARTHER = "farther"
    ASIDE = "aside"
    HELD_OR_ASIDE = "held_or_aside"
    UNKNOWN = "unknown"


_BACK = tuple(-share for share in ROLLED)
_ANSWERS: dict[Agreement, tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]] = {
    Agreement.AGREES: ((ASKEW_DEG, (*ROLLED, 1.75, 2.0)),),
    Agreement.STANDS: ((ASKEW_DEG, (-0.35, -0.2, 0.0, 0.2, 0.35)),),
    Agreement.OPPOSITE: ((ASKEW_DEG, _BACK), (BEHIND_DEG, ROLLED)),
    Agreement.FARTHER: ((ASKEW_DEG, (2.25, 2.5, 3.0, 3.5, 4.0)),),
    Agreement.ASIDE: ((ASIDE_DEG, ROLLED),),
}
"""Of each answer, angles of the lidar, to both sides, and shares of the wheels' way."""


def _tried() -> tuple[Floats, list[int]]:
    """Return what is tried, (n, 4): share of the way and 1, each turned as the lidar; and where each answer begins."""
    rows: list[tuple[float, float, float, float]] = []
    begins = []
    for parts in _ANSWERS.values():
        begins.append(len(rows))
        for angles_deg, shares in parts:
            for angle_deg in (*angles_deg, *(-angle_deg for angle_deg in angles_deg)):
                x, y = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
                rows += [(share * x, share * y, x, y) for share in shares]
    return np.array(rows), begins


_TRIED, _BEGINS = _tried()


@dataclass(frozen=True, slots=True, eq=False)
class _Key:
    """First scan of a window: its patches, time and pose."""

    patches: Patches
    stamp_s: float
    pose: OdometryState


class MotionAgreement:
    """Collects the windows of a drive. `learn` once per scan, in order; about 0.4 ms where a window ends."""

    def __init__(self, lidar_m: complex) -> None:
        self._lidar_m = lidar_m
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._key: _Key | None = None
        self._motor: MotorState | None = None
        self._slipped_s = -math.inf
        self._squares, self._products = np.zeros((4, 4)), np.zeros(4)
        self._windows = 0
        self._clearer = CLEARER

    def learn(self, scan: Scan, motor: MotorState, pose: OdometryState) -> Agreement:
        """Process one scan; UNKNOWN where it ends no window, and while no answer is clear."""
        if self._slips(motor):
            self._slipped_s = scan.stamp_s
        rolls = STANDING_MPS < abs(motor.speed_mps) <= ROLLS_MPS
        if not rolls or scan.stamp_s - self._slipped_s < HOLDS_AFTER_S:
            self._key = None
            return Agreement.UNKNOWN
        key = self._key
        if key is not None and scan.stamp_s - key.stamp_s <= WINDOW_S:
            moved_m, turn_rad = _moved(key.pose, pose)
            if abs(moved_m) < WINDOW_M and abs(turn_rad) < WINDOW_RAD:
                return Agreement.UNKNOWN
        else:
            key = None
        patches = patches_of(scan)
        self._key = _Key(patches, scan.stamp_s, pose)
        found = displacement(key.patches, patches, turn_rad) if key is not None else None
        if found is None:
            return Agreement.UNKNOWN
        self._add(found, moved_m)
        self._clearer = CLEARER if scan.correction is None else CLEARER_OF_SLOW
        return self._answer()

    def _slips(self, motor: MotorState) -> bool:
        last, self._motor = self._motor, motor
        if last is None or motor.stamp_s <= last.stamp_s:
            return False
        return abs(last.speed_mps) - abs(motor.speed_mps) > GRIP_MPS2 * (motor.stamp_s - last.stamp_s)

    def _add(self, found: Displacement, moved_m: complex) -> None:
        """Add a window. moved_m: shift of base_link by the wheels."""
        swung_m = self._lidar_m * (cmath.rect(1.0, found.turn_rad) - 1.0)  # by the scene's own turn
        values, axes = np.linalg.eigh(found.information)
        variance = (WAY_SHARE * abs(moved_m + swung_m)) ** 2 + WAY_M**2
        weight = (axes * (values / (1.0 + values * variance))) @ axes.T
        x, y, u, v = moved_m.real, moved_m.imag, swung_m.real, swung_m.imag
        moves = np.array(((x, -y, u, -v), (y, x, v, u)))
        weighted = moves.T @ weight
        self._squares = MEMORY * self._squares + weighted @ moves
        self._products = MEMORY * self._products + weighted @ (found.shift_m.real, found.shift_m.imag)
        self._windows += 1

    def _answer(self) -> Agreement:
        if self._windows < ENOUGH_WINDOWS:
            return Agreement.UNKNOWN
        squares = ((_TRIED @ self._squares) * _TRIED).sum(axis=1) - 2.0 * (_TRIED @ self._products)
        fits = np.minimum.reduceat(squares, _BEGINS)
        worse = fits - fits.min()
        agrees, stands, opposite, farther, aside = worse
        if farther == 0.0 and agrees < SURELY_FARTHER:
            return Agreement.UNKNOWN
        if 0.0 < agrees < self._clearer:
            return Agreement.UNKNOWN
        if np.count_nonzero(worse < CLEARER) == 1:
            return tuple(_ANSWERS)[int(fits.argmin())]
        if min(agrees, farther) < CLEARER:
            return Agreement.UNKNOWN
        if stands < CLEARER:
            is_open = stands < ALIKE and min(opposite, aside) < ALIKE
            return Agreement.HELD_OR_ASIDE if is_open else Agreement.UNKNOWN
        return Agreement.OPPOSITE if opposite < aside else Agreement.ASIDE


def _moved(start: OdometryState, end: OdometryState) -> tuple[complex, float]:
    """Return the shift [m] of base_link in the frame of the first pose, and its turn [rad]."""
    off_m = complex(end.x_m - start.x_m, end.y_m - start.y_m)
    return off_m * cmath.rect(1.0, -start.yaw_rad), math.remainder(end.yaw_rad - start.yaw_rad, math.tau)
