"""The speed that a lidar allows: by its step, its range and its rate; and the guard that keeps to it."""

import math

import numpy as np
import pytest

from tests.runtime.in_earnest import judged
from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.method_settings import SweptSafetySettings
from wallride.runtime.control.safety.body import Body
from wallride.runtime.control.safety.lidar_reach import LEG_BEAMS, LEG_M, WAY_M, reach_mps, sight_m
from wallride.runtime.control.safety.stopping import stopping_distance_m
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.vehicle import CarSettings

CAR = CarSettings(max_speed_mps=8.0)
BODY = Body(SweptSafetySettings(), CAR)


def of(step_deg: float, range_max_m: float, hz: float) -> float:
    return reach_mps(math.radians(step_deg), range_max_m, 1 / hz, BODY)


def test_a_ust_10lx_bounds_no_car():
    assert of(0.25, 30.0, 40.0) > 8.0


def test_each_shortcoming_costs_speed():
    best = of(0.25, 30.0, 10.0)
    assert of(0.25, 30.0, 5.5) < best
    assert of(1.0, 30.0, 40.0) < of(0.5, 30.0, 40.0) < of(0.25, 30.0, 40.0)
    assert of(0.25, 4.0, 40.0) < of(0.25, 12.0, 40.0)


@pytest.mark.parametrize(("step_deg", "range_max_m", "hz"), [(0.5, 12, 8), (0.6, 10, 7), (1.0, 12, 10), (1.2, 6, 5.5)])
def test_a_stop_from_there_is_possible_and_a_turn_is_a_short_way(step_deg, range_max_m, hz):
    speed_mps = of(step_deg, range_max_m, hz)
    seen_m = sight_m(math.radians(step_deg), range_max_m)
    assert LEG_BEAMS * math.radians(step_deg) * seen_m <= LEG_M + 1e-9
    settings = SweptSafetySettings()
    needed_m = stopping_distance_m(speed_mps, 2 / hz + settings.actuation_s, settings.hard_share * BODY.grip_mps2)
    assert needed_m < seen_m - (CAR.front_m - CAR.lidar_x_m)
    assert speed_mps / hz <= WAY_M + 1e-9


def scans(hz: float, beams: int, range_max_m: float, count: int = 6) -> list[Scan]:
    ranges_m = np.full(beams, 0.7 * range_max_m, np.float32)
    return [Scan(k / hz, k / hz, -math.pi, math.tau / beams, 0.15, range_max_m, ranges_m, k) for k in range(count)]


def motor(stamp_s: float) -> MotorState:
    return MotorState(stamp_s, 0.5, 0.5 * stamp_s, 0.0)


def guard_after(hz: float, beams: int, range_max_m: float) -> SweptGuard:
    guard = SweptGuard(SweptSafetySettings(), CAR)
    for scan in scans(hz, beams, range_max_m):
        guard.look(scan, motor(scan.stamp_s))
    return guard


def test_the_guard_bounds_the_speed_and_the_status_says_why():
    guard = guard_after(5.5, 360, 12.0)
    assert guard.assessment is not None
    verdict = judged(guard.assessment, 8.0, 0.0)
    assert verdict.forward_mps == pytest.approx(WAY_M * 5.5)
    assert verdict.reason == "no faster with this lidar (6 Hz, 1 deg a beam, 12 m)"
    assert "the lidar allows 1.1 m/s: 6 Hz, 1 deg a beam, 12 m" in guard.words
    assert guard.assessment.limit_of_sensing(8.0, 0.0).forward_mps == verdict.forward_mps  # above every law


def test_a_lidar_that_allows_more_than_the_car_is_not_mentioned():
    guard = guard_after(40.0, 1440, 30.0)
    assert guard.assessment is not None
    assert not guard.words
    assert guard.assessment.limit_of_sensing(8.0, 0.0).forward_mps == math.inf


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@pytest.mark.parametrize(("hz", "late_s", "stale_s"), [(40.0, 0.10, 0.25), (10.0, 0.17, 0.32), (5.5, 0.251, 0.401)])
def test_a_scan_is_late_and_stale_later_with_a_slow_lidar(hz, late_s, stale_s):
    clock = Clock()
    guard = SweptGuard(SweptSafetySettings(), CAR, clock=clock)
    for scan in scans(hz, 1440, 30.0):
        clock.now_s = scan.stamp_s
        assessment = guard.look(scan, motor(scan.stamp_s))
    begin_s = clock.now_s
    for after_s, reason in ((late_s - 0.005, ""), (late_s + 0.005, "late"), (stale_s + 0.005, "too old")):
        clock.now_s = begin_s + after_s
        assert reason in assessment.limit_of_sensing(0.5, 0.0).reason
        assert (assessment.limit_of_sensing(0.5, 0.0).forward_mps == 0.0) == (reason == "too old")
