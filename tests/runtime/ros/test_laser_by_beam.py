"""ROS 2's /scan: the time of each beam, and what came back; the laws and recordings keep the sweep's end and NaN."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from tests.runtime.ros.samples import SCAN, STAMP_NS
from wallride.drivers.api import Scan
from wallride.drivers.hokuyo.ranges import RangeDecoder
from wallride.runtime.ros import messages
from wallride.sim.devices.scip_encode import encode_samples

RAY_S = 0.025 / 1440
STORE = get_typestore(Stores.ROS2_HUMBLE)


def read(payload: bytes):
    message: Any = STORE.deserialize_cdr(payload, "sensor_msgs/msg/LaserScan")
    return message, message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def test_the_stamp_is_that_of_the_first_beam_and_the_last_one_is_at_the_sweeps_end():
    message, first_ns = read(messages.ros_laser_scan(STAMP_NS, replace(SCAN, ray_s=RAY_S), 0.025))
    assert message.time_increment == pytest.approx(RAY_S)
    assert first_ns + 1080 * message.time_increment * 1e9 == pytest.approx(STAMP_NS, abs=2000)
    assert STAMP_NS - first_ns == pytest.approx(0.01875e9, rel=0.001), "18.75 ms of 270 degrees"


def test_a_sensor_upside_down_saw_the_first_beam_of_the_array_last():
    message, first_ns = read(messages.ros_laser_scan(STAMP_NS, replace(SCAN, ray_s=-RAY_S), 0.025))
    assert (first_ns, message.time_increment) == (STAMP_NS, pytest.approx(-RAY_S))


def test_what_came_back_is_told_to_ros_and_to_nobody_else():
    samples = encode_samples(np.array([0, 30, 1000, 65533]), 3)
    decoder = RangeDecoder(4, 60, 30000)
    ranges_m = decoder.decode(samples)
    assert ranges_m is not None
    scan = Scan(10.0, 10.0, -0.1, 0.1, 0.06, 30.0, ranges_m, 0, RAY_S, decoder.returns(samples))
    told, _ = read(messages.ros_laser_scan(STAMP_NS, scan, 0.025))
    np.testing.assert_array_equal(told.ranges, np.array([np.nan, -np.inf, 1.0, np.inf], np.float32))
    own, own_ns = read(messages.laser_scan(STAMP_NS, scan, 0.025))
    np.testing.assert_array_equal(own.ranges, np.array([np.nan, np.nan, 1.0, np.nan], np.float32))
    assert (own_ns, own.time_increment) == (STAMP_NS, pytest.approx(RAY_S))


def test_a_driver_that_cannot_tell_leaves_nan_and_one_time_for_all_beams():
    message, stamp_ns = read(messages.ros_laser_scan(STAMP_NS, SCAN, 0.025))
    np.testing.assert_array_equal(message.ranges, SCAN.ranges_m)
    assert (stamp_ns, message.time_increment) == (STAMP_NS, 0.0)
