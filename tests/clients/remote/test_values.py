"""Each topic's message becomes a value in SI units; what is none becomes a clear error."""

import math

import numpy as np
import pytest

from tests.runtime.ros.samples import RANGES_M, SAMPLES, STAMP_NS
from wallride.clients.decoding import UnreadableError
from wallride.clients.remote import values
from wallride.clients.remote.values import value_of
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.wire import topics

STAMP_S = STAMP_NS / 1e9
TAKEN_S = 1.79e9


def read(topic):
    return value_of(topic, SAMPLES[topic], TAKEN_S)


def test_a_scan_has_ranges_bearings_and_places():
    scan = read(topics.SCAN)
    assert scan.stamp_s == pytest.approx(STAMP_S, abs=1e-6)
    np.testing.assert_array_equal(scan.ranges_m, RANGES_M)
    assert (scan.range_min_m, scan.range_max_m) == pytest.approx((0.02, 30.0))
    assert scan.angles_rad[[0, -1]] == pytest.approx([-2.3562, -2.3562 + 1080 * 0.0043633], abs=1e-4)
    assert scan.points_m.shape == (2, 1081)
    at = 540
    assert np.hypot(*scan.points_m[:, at]) == pytest.approx(RANGES_M[at])
    assert math.atan2(*scan.points_m[::-1, at]) == pytest.approx(scan.angles_rad[at])


def test_odometry_drives_motor_battery_and_imu_are_numbers():
    odom = read(topics.ODOM)
    assert (odom.x_m, odom.y_m, odom.yaw_rad, odom.speed_mps, odom.yaw_rate_radps) == (
        1.0, -2.0, pytest.approx(0.5), 1.5, 0.25,
    )  # fmt: skip
    assert (read(topics.OUTPUT).speed_mps, read(topics.TELEOP).steering_rad) == (1.75, 0.25)
    motor = read(topics.MOTOR)
    assert (motor.distance_m, motor.speed_mps, motor.current_a, motor.steering_rad) == (12.25, 1.5, 6.5, -0.1)
    assert (read(topics.BATTERY).voltage_v, read(topics.BATTERY).current_a) == (11.5, 2.25)
    np.testing.assert_allclose(read(topics.IMU).turn_radps, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(read(topics.IMU).acceleration_mps2, [1.0, 2.0, 9.81])


def test_a_number_without_a_header_has_the_time_at_which_it_was_taken():
    number = read(topics.DISTANCE_ERROR)
    assert (number.value, number.stamp_s) == (-0.125, TAKEN_S)


def test_frames_and_markers():
    base, laser = read(topics.TF).transforms
    assert (base.parent, base.child, base.yaw_rad) == ("odom", "base_link", pytest.approx(math.pi / 2))
    assert (laser.parent, laser.child, laser.x_m) == ("base_link", "laser", 0.25)
    way, empty = read(topics.FOOTPRINT).markers
    assert way.points_m.tolist() == [[0.0, 1.0, 2.0], [0.5, 0.25, -0.5]]
    assert empty.points_m.shape == (2, 0)


def test_reports_are_read_like_dictionaries():
    status = value_of(topics.STATUS, b'{"state": "driving"}', TAKEN_S)
    assert isinstance(status, values.FieldsSample)
    assert status["state"] == "driving"
    assert read(topics.DIAGNOSTICS)["status"][0]["name"] == "lidar"


@pytest.mark.parametrize("topic", TYPES)
def test_every_topic_is_read(topic):
    assert type(read(topic)) in values.Value.__args__


@pytest.mark.parametrize("topic", [*TYPES, topics.STATUS, topics.BEAT])
def test_what_is_none_is_an_error_that_names_the_topic(topic):
    with pytest.raises(UnreadableError, match=topic):
        value_of(topic, b"\x00\x01", TAKEN_S)
