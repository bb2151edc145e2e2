"""A car that drives a path and promises it: around a bend of constant curvature that ends where a wall is ahead."""

import math
from dataclasses import replace

import numpy as np

from tests.runtime.control.safety.swept_scenes import Car, world
from tests.runtime.control.scans import CAR
from wallride.runtime.arbitration.promise import Promise
from wallride.runtime.control.safety.manoeuvre_rollout import FRONT_SHARE

SPEED_MPS, BEND_PER_M, EASES_M, STEP_M = 3.0, 0.5, 0.5, 0.1
PERIOD_S = 0.025
SLIP_RAD_PER_MPS2 = 1.0 / (0.8 * 9.81 * 5.5)
SCANS = 50
OPEN = world()
BESIDE = world((-2.0, 0.8, 6.0, 0.8))
"""The wall that the bend would lead to, and that the promise runs along."""


def way(ends_m=0.0, bend_per_m=BEND_PER_M, reach_m=9.0):
    """Return places (n,) and directions (n,) of a path from its begin on, every STEP_M; its bend ends after ends_m."""
    along_m = STEP_M * np.arange(round(reach_m / STEP_M) + 1)
    bend = bend_per_m * np.clip(1.0 - (along_m - ends_m) / EASES_M, 0.0, 1.0)
    course_rad = np.concatenate([[0.0], np.cumsum(bend[:-1] * STEP_M)])
    middle_rad = course_rad[:-1] + bend[:-1] * STEP_M / 2
    return np.concatenate([[0.0], np.cumsum(STEP_M * np.exp(1j * middle_rad))]), course_rad


def promise_of(stamp_s, ends_m=0.0, speed_mps=SPEED_MPS, bend_per_m=BEND_PER_M, margin_m=0.02):
    """Return the promise of a path whose bend ends after ends_m, seen from a car in that bend."""
    places_m, _ = way(ends_m, bend_per_m)
    seen_m = places_m * np.exp(-1j * SLIP_RAD_PER_MPS2 * SPEED_MPS**2 * bend_per_m)
    return Promise(np.stack([seen_m.real, seen_m.imag]), np.full(seen_m.size, speed_mps), margin_m, stamp_s)


class Promising(Car):
    """A car in the bend, which ends in ends_m, and which has kept its promises for some scans."""

    def __init__(self, scans=SCANS, bend_per_m=BEND_PER_M, ends_m=0.0):
        super().__init__()
        self.bend_per_m, self.scans = bend_per_m, scans
        understeer_rad = SLIP_RAD_PER_MPS2 * (1.0 / FRONT_SHARE - 1.0) * SPEED_MPS**2 * bend_per_m
        self.wheel_rad = math.atan(CAR.wheelbase_m * bend_per_m) + understeer_rad
        for number in range(scans, 0, -1):
            self.drive(OPEN, ends_m + number * PERIOD_S * SPEED_MPS)

    def see(self, ranges_m, **state):
        state = {"speed_mps": SPEED_MPS, "wheel_rad": self.wheel_rad, "moved_m": PERIOD_S * SPEED_MPS} | state
        return self.look(ranges_m, **state)

    def drive(self, ranges_m, ends_m, **state):
        """Drive on by one scan; return the verdict."""
        assessment = self.see(ranges_m, **state)
        return self.told(assessment, promise_of(self.now_s, ends_m, bend_per_m=self.bend_per_m))

    def told(self, assessment, promise, speed_mps=SPEED_MPS, steering_rad=None):
        """Send a command with a promise; return the verdict."""
        steering_rad = self.wheel_rad if steering_rad is None else steering_rad
        verdict, memory = assessment.judge(speed_mps, steering_rad, assessment.memory, promise)
        assessment.commit(memory)
        self.guard.learn()
        return verdict

    @property
    def record(self):
        return self.guard.memory.promises


def by_arc(assessment, memory, speed_mps=SPEED_MPS, steering_rad=0.0):
    """Return the verdict on the same command without a promise."""
    fresh = replace(assessment, strip=assessment.strip.copied())
    return fresh.judge(speed_mps, steering_rad, memory)[0]


def judged(car, ranges_m, promise, **command):
    """Return the verdict with a promise and the one without, of one scan."""
    assessment = car.see(ranges_m)
    plain = by_arc(assessment, car.guard.memory, SPEED_MPS, command.get("steering_rad", car.wheel_rad))
    return car.told(assessment, promise(car.now_s), **command), plain


def changed(path=lambda path_m: path_m, speed=lambda speed_mps: speed_mps, margin_m=0.02, at_s=0.0):
    """Return how the honest promise is changed."""

    def made(stamp_s):
        honest = promise_of(stamp_s)
        return Promise(path(honest.path_m.copy()), speed(honest.speed_mps.copy()), margin_m, stamp_s + at_s)

    return made
