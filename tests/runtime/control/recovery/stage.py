"""A car that rolls as it is told in a room of boxes, with its safety and its way out."""

import math
from copy import deepcopy
from functools import cache
from typing import Any

import numpy as np

from tests.runtime.control.scans import BEARING_RAD, CAR, SCAN_S, scan_of
from tests.runtime.in_earnest import judged
from wallride.drivers.api import Drive, MotorState
from wallride.runtime.control.recovery.way_out import Recovery
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import RecoverySettings, SweptSettings
from wallride.sim.world.pose import CAR as OUTLINE
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry, box

WAY = Drive(1.0, 0.0)


def room(*boxes):
    walls = [*box(0.0, 0.0, 12.0, 12.0, 0.0)]
    for x_m, y_m, length_m, width_m in boxes:
        walls += [*box(x_m, y_m, length_m, width_m, 0.0)]
    return SegmentGeometry(np.array(walls))


AHEAD = room((0.75, 0.0, 0.5, 0.3))
"""A box 8 cm before the bumper, in the middle of a room."""


class Stage:
    """A car that rolls exactly as told, its safety, and its way out; `step` is one scan."""

    def __init__(self, surroundings, **settings):
        self.surroundings = surroundings
        self.guard = SweptGuard(SweptSettings(), CAR)
        self.recovery = Recovery(RecoverySettings(**settings))
        self.pose = Pose(-1.5, 0.0, 0.0)
        self.now_s = self.way_m = self.speed_mps = self.wheel_rad = 0.0
        self.said = []
        self.assessment: Any = None
        self.advice: Any = None

    def look(self):
        self.now_s += SCAN_S
        at = self.pose.ahead(CAR.lidar_x_m)
        ranges_m = self.surroundings.cast(at.x_m, at.y_m, BEARING_RAD + self.pose.yaw_rad)
        state = MotorState(self.now_s, self.speed_mps, self.way_m, self.wheel_rad)
        self.assessment = self.guard.look(scan_of(ranges_m, self.now_s), state)
        return state

    def step(self, wish=WAY, *, believed=True, toward_rad=math.nan):
        state = self.look()
        advice = self.advice = self.recovery.step(
            self.assessment, wish, state, believed=believed, toward_rad=toward_rad
        )
        if advice.words and (not self.said or self.said[-1] != advice.words):
            self.said.append(advice.words)
        drive = advice.drive or wish or Drive(0.0, 0.0)
        verdict = judged(self.assessment, drive.speed_mps, drive.steering_rad)
        self.speed_mps = max(-verdict.reverse_mps, min(verdict.forward_mps, drive.speed_mps))
        self.wheel_rad += max(-0.08, min(0.08, drive.steering_rad - self.wheel_rad))
        step_m = self.speed_mps * SCAN_S
        turn_rad = step_m * math.tan(self.wheel_rad) / CAR.wheelbase_m
        moved = self.pose.ahead(step_m)
        self.pose = Pose(moved.x_m, moved.y_m, self.pose.yaw_rad + turn_rad)
        self.way_m += step_m
        return advice

    def go(self, seconds, wish=WAY):
        return [self.step(wish) for _ in range(round(seconds / SCAN_S))]

    def drive_up(self):
        """Drive until the car stands, and begin to count there."""
        self.go(1.0)
        while abs(self.speed_mps) > 0.0:
            self.step()
        self.said.clear()
        return self

    def manoeuvres(self, until, most_s=40.0):
        """Go on until this holds; the least clearance on the way."""
        least_m = math.inf
        for _ in range(round(most_s / SCAN_S)):
            self.step()
            least_m = min(least_m, self.clearance_m)
            if until(self):
                return least_m
        raise AssertionError(f"not within {most_s} s: {self.said[-3:]} at {self.pose}")

    @property
    def moves(self):
        """Whether the manoeuvre asks for a speed, beyond turning the wheels."""
        return self.advice.drive is not None and self.advice.drive.speed_mps != 0.0

    @property
    def last(self):
        return self.said[-1] if self.said else ""

    @property
    def clearance_m(self):
        return self.surroundings.clearance(self.pose, OUTLINE)


@cache
def _driven_up():
    return Stage(AHEAD).drive_up()


def boxed_in():
    """Return a car that has driven up to the box ahead and stands; each is one of its own."""
    return deepcopy(_driven_up())
