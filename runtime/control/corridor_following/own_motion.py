"""The car's motion from scan to scan: by wheels and steering with tyres, corrected by the scans themselves.

Steering alone is not enough: a trim of 0.02 rad turns the car by 0.06 rad in a metre, and what is left of a bend's slip
as much. A way that is carried so leaves the course by 0.3 m in half a second (measured).
"""

import math
from typing import Final, NamedTuple

from wallride.drivers.api import MotorState
from wallride.runtime.control.line_following.line_law import Moving
from wallride.runtime.control.line_following.trim import SteeringTrim
from wallride.runtime.control.line_following.tyres import Tyres
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.perception import Percept
from wallride.runtime.control.perception.scan_matching import MatchedOdometry, ScanPose

MOST_S: Final = 0.15
"""Longest time between two scans over which a way is carried."""


class _Reported(NamedTuple):
    stamp_s: float
    way_m: float
    steering_rad: float


class OwnMotion:
    """turn_radps: present yaw rate. Left is the side of the followed wall.

    trim_rad: true angle of the wheels that are told to be straight.
    """

    def __init__(self) -> None:
        self.turn_radps = 0.0
        self._last: _Reported | None = None
        self._matched = MatchedOdometry()
        self._pose = ScanPose()
        self._found = ScanPose()
        self._trim = SteeringTrim()

    @property
    def trim_rad(self) -> float:
        """Return the learnt trim."""
        return self._trim.rad

    def step(self, seen: Percept, side: float, tyres: Tyres) -> ScanPose | None:
        """Return the car at a scan as seen from where it was at the last one; None where that is not known.

        side: 1 where the followed wall is on the left, -1 on the right.
        """
        motor, stamp_s = seen.motor, seen.scan.stamp_s
        last, self._last = self._last, None
        if motor is None:
            self._begin()
            return None
        way_m = motor.distance_m + motor.speed_mps * min(max(stamp_s - motor.stamp_s, 0.0), MOST_S)
        self._last = _Reported(stamp_s, way_m, side * motor.steering_rad)
        since_s = stamp_s - last.stamp_s if last is not None else 0.0
        if last is None or not 0.0 < since_s <= MOST_S:
            self._begin()
            self._matched.learn(seen.view, self._odometry(motor))
            return None
        before = Moving(0j, 0.0, (way_m - last.way_m) / since_s, self.turn_radps, self._trim.rad)
        moved = before.later(since_s, last.steering_rad, tyres)
        self.turn_radps = moved.turn_radps
        place_m = moved.place_m if side > 0 else moved.place_m.conjugate()
        self._pose = self._pose.placed(ScanPose(place_m, side * moved.yaw_rad))
        self._matched.learn(seen.view, self._odometry(motor))
        found = self._matched.pose(self._odometry(motor))
        step, self._found = found.seen_from(self._found), found
        now = Moving(0j, side * found.yaw_rad, motor.speed_mps, self.turn_radps, self._trim.rad)
        self._trim.learn(now, side * motor.steering_rad, since_s, tyres)
        return step if side > 0 else ScanPose(step.at_m.conjugate(), -step.yaw_rad)

    def _begin(self) -> None:
        self.turn_radps = 0.0
        self._matched.forget()

    def _odometry(self, motor: MotorState) -> OdometryState:
        at_m, yaw_rad = self._pose
        return OdometryState(at_m.real, at_m.imag, math.remainder(yaw_rad, math.tau), motor.speed_mps, self.turn_radps)
