"""What is taken of a scan and of the wheels before the map is asked."""

import math

import numpy as np
import pytest

from tests.runtime.control.localization.rooms import BEAMS, FIRST_RAD, STEP_RAD, report
from wallride.drivers.api import Scan
from wallride.runtime.control.localization.scan_points import BEAMS as LOOKED_AT
from wallride.runtime.control.localization.scan_points import AxleMotion, scan_points
from wallride.runtime.control.localization.wheel_steps import WheelSteps

LIDAR = 0.27 + 0.05j


@pytest.mark.parametrize("ray_s", [1.7e-5, -1.7e-5])
def test_beams_are_put_where_a_lidar_at_the_last_beam_sees_them(ray_s):
    twist = AxleMotion(4.0, -0.3, 2.0)
    numbers = np.arange(BEAMS)
    age_s = abs(ray_s) * (BEAMS - 1 - numbers if ray_s > 0 else numbers)
    wall_x_m = 3.0
    yaw = -twist.turn_radps * age_s
    axle = (complex(twist.ahead_mps, twist.left_mps) * (np.exp(1j * yaw) - 1.0)) / (1j * twist.turn_radps)
    lidar = axle + LIDAR * np.exp(1j * yaw)
    ahead = np.exp(1j * (FIRST_RAD + STEP_RAD * numbers + yaw))
    ranges_m = np.where(ahead.real > 0.2, (wall_x_m - lidar.real) / ahead.real, np.nan).astype(np.float32)
    scan = Scan(1.0, 1.0, FIRST_RAD, STEP_RAD, 0.02, 30.0, ranges_m, 0, ray_s)
    seen = scan_points(scan, LIDAR, twist)
    assert seen.places_m.real == pytest.approx(wall_x_m, abs=0.002)
    assert np.abs(seen.ahead) == pytest.approx(1.0)
    raw = scan_points(scan, LIDAR, AxleMotion(0.0, 0.0, 0.0))
    assert np.ptp(raw.places_m.real) > 0.1, "what is taken out is more than 10 cm"


@pytest.mark.parametrize("beams", [1, 90, 181, 1081, 4000])
def test_a_bounded_number_of_beams_is_looked_at(beams):
    scan = Scan(0.0, 0.0, -1.0, 2.0 / beams, 0.02, 30.0, np.full(beams, 2.0, np.float32), 0)
    assert min(beams, LOOKED_AT) <= scan_points(scan, LIDAR, AxleMotion(0.0, 0.0, 0.0)).places_m.size <= 2 * LOOKED_AT


def test_legs_and_cars_that_stand_free_are_told_from_walls():
    ranges_m = np.full(360, 4.0, np.float32)
    ranges_m[100:110] = 1.0  # 17 cm wide
    ranges_m[150:250] = 2.0  # 3.5 m wide
    ranges_m[300:] = 1.5  # up to the edge of the view
    ranges_m[105] = np.nan
    scan = Scan(0.0, 0.0, -math.pi, math.tau / 360, 0.02, 30.0, ranges_m, 0)
    seen = scan_points(scan, 0j, AxleMotion(0.0, 0.0, 0.0))
    there_m = np.abs(seen.places_m)
    assert seen.alone[there_m < 1.1].all()
    assert not seen.alone[there_m > 1.1].any()


def test_a_report_is_carried_to_the_scan_and_the_next_one_corrects_it():
    wheels = WheelSteps(3.2)
    assert wheels.to(1.000, report(0.990, 5.00, 2.0)) is None, "the first scan has no step"
    step = wheels.to(1.025, report(1.010, 5.04, 2.0))
    assert step.way_m == pytest.approx(5.04 + 2.0 * 0.015 - (5.00 + 2.0 * 0.010))
    assert step.since_s == pytest.approx(0.025)
    again = wheels.to(1.050, report(1.010, 5.04, 2.0))
    assert again.way_m == pytest.approx(2.0 * 0.025), "without a new report the last speed goes on"


def test_locked_wheels_do_not_stop_the_car():
    wheels = WheelSteps(3.2)
    wheels.to(1.00, report(1.00, 5.0, 4.0))
    step = wheels.to(1.02, report(1.02, 5.0, 0.0))
    assert step.slides
    assert step.way_m == pytest.approx(0.02 * 3.9)
    assert not wheels.to(1.04, report(1.04, 5.08, 3.85)).slides, "they turn again"


def test_a_stale_report_tells_nothing():
    wheels = WheelSteps(3.2)
    wheels.to(1.0, report(1.0, 5.0, 2.0))
    assert wheels.to(1.4, report(1.0, 5.0, 2.0)) is None
    assert wheels.to(1.5, None) is None
    assert wheels.to(1.525, report(1.52, 6.0, 2.0)) is None, "nothing is integrated across the gap"
    assert wheels.to(1.550, report(1.54, 6.04, 2.0)) is not None


def test_the_servo_follows_the_command_at_its_own_rate():
    wheels = WheelSteps(2.0)
    wheels.to(0.0, report(0.0))
    angles = [wheels.to(0.025 * n, report(0.025 * n, steering_rad=0.3)).steering_rad for n in range(1, 12)]
    assert angles[0] == pytest.approx(0.025)
    assert angles[-1] == pytest.approx(0.3)
