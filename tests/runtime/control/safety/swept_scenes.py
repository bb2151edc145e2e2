"""Scenes and a car of the swept safety's tests."""

import numpy as np

from tests.runtime.control.scans import BEARING_RAD, CAR, SCAN_S, scan_of
from tests.runtime.in_earnest import judged
from wallride.drivers.api import MotorState
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.sim.world.segments import SegmentGeometry

SETTINGS = SweptSettings()
REACTION_S = 0.05
FRONT_M = CAR.front_m + SETTINGS.front_margin_m


def world(*walls_m, empty_m=8.0):
    """Ranges to segments (x0, y0, x1, y1) in base_link; elsewhere something far."""
    walls = SegmentGeometry(np.array(walls_m, np.float64).reshape(-1, 4))
    return np.fmin(walls.cast(CAR.lidar_x_m, 0.0, BEARING_RAD.astype(np.float64)), empty_m)


def wall_at(x_m, half_m=2.0):
    return (x_m, -half_m, x_m, half_m)


class Car:
    """A guard with scans and motor reports on a clock of their own."""

    def __init__(self, clock=None, **settings):
        self.now_s = 100.0
        self.guard = SweptGuard(SweptSettings(**settings), CAR, clock=clock)
        self.distance_m = 0.0

    def look(self, ranges_m, speed_mps=0.0, wheel_rad=0.0, age_s=0.0, moved_m=0.0, motor=True):
        self.now_s += SCAN_S
        self.distance_m += moved_m
        state = MotorState(self.now_s, speed_mps, self.distance_m, wheel_rad) if motor else None
        return self.guard.look(scan_of(ranges_m, self.now_s - age_s, late_s=age_s), state)


def judge(ranges_m, wanted_mps, steering_rad=0.0, **state):
    return judged(Car().look(ranges_m, **state), wanted_mps, steering_rad)
