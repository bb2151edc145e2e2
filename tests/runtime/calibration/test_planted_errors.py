"""Errors planted in a simulated car are found: several seeds, 20 mm of noise, outliers and drop-outs, own parts."""

import numpy as np
import pytest

from tests.runtime.calibration.planted import (
    CORRIDOR,
    TRUE_OFFSET_RAD,
    TRUE_SPEED,
    YAW_RAD,
    arcs_of,
    braking_of,
    delays_of,
    planted_car,
)
from wallride.runtime.calibration.near_parts import near_parts_m
from wallride.sim.car.wiring import NO_ERRORS
from wallride.sim.world.own_parts import profile

DEG = np.radians(1.0)


@pytest.mark.parametrize(("seed", "own_parts"), [(0, "posts"), (2, "film")])
def test_all_planted_errors_are_found(seed, own_parts):
    car = planted_car(seed, own_parts=own_parts)
    arcs = arcs_of(car)
    fit = arcs.fit
    assert fit.speed_factor.value == pytest.approx(TRUE_SPEED, rel=0.01)
    assert fit.wheelbase_m.value == pytest.approx(0.33, rel=0.01)
    assert fit.offset_rad.value == pytest.approx(TRUE_OFFSET_RAD, abs=0.3 * DEG)
    assert fit.lidar_yaw_rad.value == pytest.approx(YAW_RAD, abs=0.3 * DEG)
    assert (fit.lidar_x_m.value, fit.lidar_y_m.value) == pytest.approx((0.29, 0.02), abs=0.01)
    assert not any((fit.speed_factor.why, fit.wheelbase_m.why, fit.offset_rad.why, fit.lidar_y_m.why))
    servo, motor = delays_of(car, arcs)
    assert (servo.delay_s.value, motor.delay_s.value) == pytest.approx((0.06, 0.06), abs=0.005)
    deceleration = braking_of(car, arcs, motor.delay_s.value)
    assert deceleration.value == pytest.approx(0.8 * 9.81, rel=0.06)
    assert car.twin.contact_mps is None
    true_m = profile(own_parts, -135.0, 135.0, 1081).range_m
    both = np.isfinite(true_m) & np.isfinite(arcs.part_m)
    assert np.count_nonzero(both) > 0.6 * np.count_nonzero(np.isfinite(arcs.part_m))
    assert np.median(np.abs(true_m[both] - arcs.part_m[both])) < 0.02


def test_a_car_without_errors_stays_as_it_is():
    car = planted_car(7, errors=NO_ERRORS, mount_x_m=0.27, mount_y_m=0.0, mount_yaw_rad=0.0)
    fit = arcs_of(car).fit
    assert fit.speed_factor.value == pytest.approx(1.0, rel=0.006)
    assert fit.offset_rad.value == pytest.approx(0.0, abs=0.002)


def test_a_bare_corridor_does_not_tell_the_speed():
    fit = arcs_of(planted_car(1, CORRIDOR)).fit
    assert "how far" in fit.speed_factor.why


def test_no_parts_are_found_on_a_car_without_them():
    car = planted_car(3)
    arcs = arcs_of(car)
    assert not np.isfinite(arcs.part_m).any()
    assert not np.isfinite(near_parts_m(car.seen.trace().ranges_m, car.seen.kind)).any()
