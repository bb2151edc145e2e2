"""Scenes and a car of the swept safety's tests."""

import math

import numpy as np

from tests.runtime.in_earnest import judged
from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import CarSettings

BEAMS = 1081
STEP_RAD = math.radians(0.25)
BEARING_RAD = STEP_RAD * (np.arange(BEAMS) - BEAMS // 2)
CAR = CarSettings()
SETTINGS = SweptSettings()
REACTION_S = 0.05
FRONT_M = CAR.front_m + SETTINGS.front_margin_m


def world(*walls_m, empty_m=8.0):
    """Ranges to segments (x0, y0, x1, y1) in base_link; elsewhere something far."""
    ranges_m = np.full(BEAMS, empty_m)
    cos, sin = np.cos(BEARING_RAD), np.sin(BEARING_RAD)
    for x0, y0, x1, y1 in walls_m:
        ax, ay, dx, dy = x0 - CAR.lidar_x_m, y0, x1 - x0, y1 - y0
        cross = cos * dy - sin * dx
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (ax * dy - ay * dx) / cross
            share = (ax * sin - ay * cos) / cross
        hit = (along > 0) & (share >= 0) & (share <= 1)
        ranges_m = np.where(hit, np.minimum(ranges_m, along), ranges_m)
    return ranges_m


def wall_at(x_m, half_m=2.0):
    return (x_m, -half_m, x_m, half_m)


class Car:
    """A guard with scans and motor reports on a clock of their own."""

    def __init__(self, clock=None, **settings):
        self.now_s = 100.0
        self.guard = SweptGuard(SweptSettings(**settings), CAR, clock=clock)
        self.distance_m = 0.0

    def look(self, ranges_m, speed_mps=0.0, wheel_rad=0.0, age_s=0.0, moved_m=0.0, motor=True):
        self.now_s += 0.025
        self.distance_m += moved_m
        state = MotorState(
            self.now_s, speed_mps, self.distance_m, wheel_rad, 12.0, 0.0, 0.0, 20.0, "", timed_out=False, killed=False
        )
        ranges_m = np.asarray(ranges_m, np.float32)
        scan = Scan(self.now_s - age_s, self.now_s, -STEP_RAD * (BEAMS // 2), STEP_RAD, 0.02, 30.0, ranges_m, 0)
        return self.guard.look(scan, state if motor else None)


def judge(ranges_m, wanted_mps, steering_rad=0.0, **state):
    return judged(Car().look(ranges_m, **state), wanted_mps, steering_rad)
