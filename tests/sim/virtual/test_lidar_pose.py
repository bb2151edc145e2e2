"""A lidar that is mounted aside and turned: with its pose in the settings the car drives as with one in the middle."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.car.wiring import NO_ERRORS, WiringConversion, WiringErrors
from wallride.sim.lab.courses.walls import case_of
from wallride.sim.lab.figures import errors
from wallride.sim.lab.laws import build, settings_of
from wallride.sim.virtual.closed_loop import as_scan, drive
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.pose import STANDING, Pose
from wallride.sim.world.worlds import load_world

YAW_RAD, X_M, Y_M = math.radians(5.0), 0.3, -0.06
MOUNT = {"mount_x_m": X_M, "mount_y_m": Y_M, "mount_yaw_rad": YAW_RAD}
POSE = (f"car.lidar_x_m={X_M}", f"car.lidar_y_m={Y_M}", f"lidar.yaw_rad={YAW_RAD}")


def test_the_view_of_a_displaced_lidar_lies_on_the_wall():
    lidar = LidarSettings(noise_std_m=0.0, **MOUNT)
    world = load_world("straight")
    seen = scan(world, Pose(0.0, 0.0, 0.0), STANDING, 0.0, np.random.default_rng(0), lidar)
    view = ViewCache(CarSettings(lidar_x_m=X_M, lidar_y_m=Y_M)).see(as_scan(seen, lidar, 0.0, 0, YAW_RAD))
    left = view.y_m > 0.5
    assert np.count_nonzero(left) > 300
    assert np.abs(view.y_m[left] - 1.0).max() < 0.001
    assert view.lidar_m == complex(X_M, Y_M)


def mean_error_m(course, mount, assignments, wiring=None, speed_mps=1.0):
    case = case_of(course, speed_mps, 0.8, "left", 0)
    settings = settings_of("ball", "left", case.desired_m, speed_mps, assignments)
    case = replace(
        case, car=settings.car, lidar=case.lidar.model_copy(update=mount), lidar_yaw_rad=settings.lidar.yaw_rad,
        wiring=wiring,
    )  # fmt: skip
    return errors(drive(case, *build("ball", "left", case.desired_m, speed_mps, assignments)))["mean_error_m"]


@pytest.mark.parametrize("course", ["t2", "t5"])
def test_a_displaced_lidar_drives_as_well_as_one_in_the_middle(course):
    usual, told = mean_error_m(course, {}, ()), mean_error_m(course, MOUNT, POSE)
    untold = mean_error_m(course, MOUNT, ())
    assert told == pytest.approx(usual, abs=0.004)
    assert untold > told + 0.02


def test_wrong_gains_are_those_of_the_car_and_not_of_its_settings():
    own = VescSettings()
    wired = WiringErrors(speed_gain_share=1.15, servo_offset=0.03).wired(own)
    wrong = WiringConversion(own, wired)
    assert wrong.speed_share == pytest.approx(1 / 1.15)
    assert wrong.steering_rad(0.0) == pytest.approx(0.03 / 1.2135)
    assert wrong.allowed_rad(1.0) == pytest.approx((own.servo_min - own.steering_to_servo_offset) / -1.2135)
    assert NO_ERRORS.wired(own) is own
    right = WiringConversion(wired, wired)
    assert right.speed_share == 1.0
    assert right.steering_rad(0.1) == pytest.approx(0.1)
