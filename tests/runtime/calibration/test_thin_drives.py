"""A drive that tells too little gives a reason, and never a number."""

import math
from functools import lru_cache

import numpy as np
import pytest

from tests.runtime.calibration.planted import planted_car
from wallride.clients.calibration import ways
from wallride.runtime.calibration.delays import KnownMotion, fit_motor, fit_servo
from wallride.runtime.calibration.measured_car import fit_braking, measure_forward
from wallride.runtime.calibration.trace import Trace

LIDAR_M = 0.29, 0.02
KNOWN = KnownMotion(wheelbase_m=0.33, speed_factor=1.0, rate_radps=3.2)


@lru_cache
def driven(way):
    """Return a whole drive of one of the ways; changed copies are made of it."""
    car = planted_car()
    begin_s = car.now_s
    way(car)
    return car.seen.trace().between(begin_s, car.now_s)


def changed(trace, **parts):
    """Return a copy with other arrays."""
    names = (
        "kind", "sweep_s", "scan_s", "ranges_m", "motor_s", "distance_m", "speed_mps", "steering_rad", "command_s",
        "asked_mps", "asked_rad",
    )  # fmt: skip
    return Trace(*(parts.get(name, getattr(trace, name)) for name in names))


def weaves():
    return driven(ways.drive_weaves)


def stops():
    return driven(ways.drive_stops)


@pytest.mark.parametrize(
    ("drive", "why"),
    [
        (lambda: weaves().between(0.0, 0.0), "hardly moved"),
        (lambda: changed(weaves(), asked_rad=np.zeros(len(weaves().command_s))), "hardly moved"),
        (lambda: changed(weaves(), speed_mps=0.0 * weaves().speed_mps), "hardly moved"),
    ],
)
def test_a_servo_that_was_not_moved_while_driving_has_no_delay(drive, why):
    found = fit_servo(drive(), KNOWN)
    assert found.delay_s.why
    assert why in found.delay_s.why
    assert found.rate.why == found.delay_s.why


def test_a_motor_without_reports_or_changes_has_no_delay():
    trace = stops()
    assert fit_motor(trace.between(0.0, 0.0)).delay_s.why
    steady = changed(trace, asked_mps=np.full(len(trace.command_s), 1.0), speed_mps=np.full(len(trace.motor_s), 1.0))
    assert "hardly changed" in fit_motor(steady).delay_s.why


def test_one_change_of_speed_leaves_the_delay_open():
    trace = stops()
    first = float(trace.command_s[np.flatnonzero(trace.asked_mps)[0]])
    found = fit_motor(trace.between(first - 0.2, first + 0.15))
    assert found.delay_s.why


@pytest.mark.parametrize(
    "thin",
    [
        lambda trace: trace.between(0.0, 0.0),
        lambda trace: changed(trace, scan_s=trace.scan_s[:3], ranges_m=trace.ranges_m[:3]),
        lambda trace: changed(trace, scan_s=trace.scan_s[::8], ranges_m=trace.ranges_m[::8]),
        lambda trace: changed(trace, ranges_m=np.repeat(trace.ranges_m[:1], len(trace.scan_s), axis=0)),
    ],
)
def test_stops_that_no_scans_show_give_no_deceleration(thin):
    found = fit_braking(thin(stops()), 0.06)
    assert "0 stops" in found.why


def test_a_stop_counts_only_from_a_steady_speed():
    trace = stops()
    assert "0 stops" in fit_braking(changed(trace, speed_mps=0.0 * trace.speed_mps), 0.06).why


def test_the_way_forward_is_the_lidars_own_and_not_the_motors():
    trace = driven(ways.drive_arcs)
    assert measure_forward(trace.between(0.0, 0.0), LIDAR_M) is None
    for told, toward_rad in ((trace, 0.0), (changed(trace, distance_m=-trace.distance_m), math.pi)):
        way_m, found_rad = measure_forward(told, LIDAR_M)
        assert way_m > 0.1
        assert abs(found_rad) == pytest.approx(toward_rad, abs=0.1)
