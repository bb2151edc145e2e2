"""The bytes are those of ROS 2: judged by three readers that know nothing of wallride."""

import math
from dataclasses import dataclass

import numpy as np
import pycdr2
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycdr2 import types
from rosbags.typesys import Stores

from tests.runtime.ros.samples import MOTOR, RANGES_M, SAMPLES, STAMP_NS, read_as_foxglove_does, ros_store
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.ros import messages
from wallride.runtime.ros.cdr import CdrWriter
from wallride.runtime.ros.definitions import TYPES, definition, encoding
from wallride.runtime.wire import topics

STORE = ros_store()
WITHOUT_HEADER = {"std_msgs/msg/Float32"}


def decoded(topic):
    return STORE.deserialize_cdr(SAMPLES[topic], TYPES[topic])


def test_every_topic_has_a_sample():
    assert set(SAMPLES) == set(TYPES)


@pytest.mark.parametrize("topic", TYPES)
def test_rosbags_would_have_written_the_same_bytes(topic):
    assert bytes(STORE.serialize_cdr(decoded(topic), TYPES[topic])) == SAMPLES[topic]


@pytest.mark.parametrize("topic", TYPES)
def test_a_header_holds_the_stamp_to_the_nanosecond(topic):
    message = decoded(topic)
    if TYPES[topic] in WITHOUT_HEADER:
        assert not hasattr(message, "header")
        return
    many = getattr(message, "markers", None) or getattr(message, "transforms", None) or [message]
    for one in many:
        assert one.header.stamp.sec * 10**9 + one.header.stamp.nanosec == STAMP_NS


def test_a_scan_is_what_the_lidar_said():
    scan = decoded(topics.SCAN)
    np.testing.assert_array_equal(scan.ranges, RANGES_M)
    assert (scan.header.frame_id, scan.intensities.size) == ("laser", 0)
    assert scan.angle_max == pytest.approx(scan.angle_min + 1080 * scan.angle_increment, abs=1e-4)
    assert scan.angle_min == pytest.approx(-2.3562)
    assert (scan.range_min, scan.range_max, scan.scan_time) == pytest.approx((0.02, 30.0, 0.025))


def test_odometry_is_a_pose_in_odom_and_speeds_in_base_link():
    odom = decoded(topics.ODOM)
    assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "base_link")
    pose, twist = odom.pose.pose, odom.twist.twist
    assert (pose.position.x, pose.position.y) == (1.0, -2.0)
    assert 2 * math.atan2(pose.orientation.z, pose.orientation.w) == pytest.approx(0.5)
    assert (twist.linear.x, twist.angular.z) == (1.5, 0.25)


def test_a_map_is_its_cells_from_the_corner_on():
    grid = decoded(topics.MAP)
    assert (grid.header.frame_id, grid.info.width, grid.info.height) == ("map", 5, 2)
    assert grid.info.map_load_time == grid.header.stamp
    assert grid.info.resolution == pytest.approx(0.05)
    assert (grid.info.origin.position.x, grid.info.origin.position.y) == (-1.0, -2.0)
    assert list(grid.data) == [-1, 0, 100, 0, -1, -1, 0, 0, 100, 100]


def test_a_line_is_poses_with_the_time_at_each():
    line = decoded(topics.LINE)
    assert [(one.pose.position.x, one.pose.position.y) for one in line.poses] == [(1.0, -2.0), (2.0, -1.5), (2.5, 0.0)]
    first, second, _ = (one.header.stamp.sec * 10**9 + one.header.stamp.nanosec for one in line.poses)
    assert second - first == 250_000_000


def test_drives_markers_and_motor_hold_their_values():
    assert (decoded(topics.OUTPUT).drive.speed, decoded(topics.OUTPUT).drive.steering_angle) == (1.75, 0.0625)
    assert decoded(topics.DISTANCE_ERROR).data == -0.125
    (wall,) = decoded(topics.WALL).markers
    assert [(point.x, point.y) for point in wall.points] == [(0.0, 0.5), (1.0, 0.25), (2.0, -0.5)]
    assert (wall.ns, wall.type, wall.header.frame_id) == ("wall", wall.LINE_STRIP, "base_link")
    assert [len(marker.points) for marker in decoded(topics.FOOTPRINT).markers] == [3, 0]
    joints = decoded(topics.MOTOR)
    assert joints.name == ["drive", "steering"]
    assert (joints.position[0], joints.velocity[0], joints.effort[0]) == (12.25, 1.5, 6.5)
    assert joints.position[1] == MOTOR.steering_rad
    assert decoded(topics.BATTERY).current == -2.25
    assert decoded(topics.IMU).linear_acceleration.z == 9.81


def test_diagnostics_and_transforms_hold_their_values():
    lidar, motor = decoded(topics.DIAGNOSTICS).status
    assert [(pair.key, pair.value) for pair in lidar.values] == [("checksum", "1"), ("stale", "22")]
    assert (motor.level, motor.message) == (2, "Übertemperatur")
    odom, laser = decoded(topics.TF).transforms
    assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "base_link")
    assert odom.transform.rotation.z == pytest.approx(math.sqrt(0.5))
    assert laser.transform.translation.x == 0.25


@pytest.mark.parametrize("topic", TYPES)
def test_a_reader_that_has_only_our_definitions_decodes_it(topic):
    message = read_as_foxglove_does(TYPES[topic], SAMPLES[topic])
    assert message.__slots__


@dataclass
class Time(pycdr2.IdlStruct):
    sec: types.int32
    nanosec: types.uint32


@dataclass
class Header(pycdr2.IdlStruct):
    stamp: Time
    frame_id: str


@dataclass
class AckermannDrive(pycdr2.IdlStruct):
    steering_angle: types.float32
    steering_angle_velocity: types.float32
    speed: types.float32
    acceleration: types.float32
    jerk: types.float32


@dataclass
class AckermannDriveStamped(pycdr2.IdlStruct):
    header: Header
    drive: AckermannDrive


@dataclass
class LaserScan(pycdr2.IdlStruct):
    header: Header
    angle_min: types.float32
    angle_max: types.float32
    angle_increment: types.float32
    time_increment: types.float32
    scan_time: types.float32
    range_min: types.float32
    range_max: types.float32
    ranges: types.sequence[types.float32]  # type: ignore[type-arg]
    intensities: types.sequence[types.float32]  # type: ignore[type-arg]


def test_a_dds_library_decodes_scan_and_output():
    scan = LaserScan.deserialize(SAMPLES[topics.SCAN])
    np.testing.assert_array_equal(np.array(scan.ranges, np.float32), RANGES_M)
    assert scan.header == Header(Time(STAMP_NS // 10**9, STAMP_NS % 10**9), "laser")
    output = AckermannDriveStamped.deserialize(SAMPLES[topics.OUTPUT])
    assert (output.drive.speed, output.drive.steering_angle) == (1.75, 0.0625)
    assert output.serialize() == SAMPLES[topics.OUTPUT]


def fields(text):
    """Return the lines without constants, of which later distributions have more; they are not on the wire."""
    return [line for line in text.splitlines() if "=" not in line.strip("=")]


@pytest.mark.parametrize("store", [ros_store(Stores.ROS2_HUMBLE), STORE], ids=["humble", "jazzy"])
@pytest.mark.parametrize("schema", sorted(set(TYPES.values())))
def test_the_definitions_are_those_of_the_distribution(store, schema):
    theirs, _ = store.generate_msgdef(schema, ros_version=2)
    separator = "=" * 80 + "\n"
    ours, theirs = ([fields(block) for block in text.split(separator)] for text in (definition(schema), theirs))
    assert ours[0] == theirs[0]
    assert sorted(ours) == sorted(theirs)


def test_a_sample_names_its_encoding_and_its_schema():
    assert encoding("scan") == "application/cdr;sensor_msgs/msg/LaserScan"
    assert encoding("status") == "application/json"


@given(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20), st.integers(0, 5))
def test_text_of_any_length_leaves_the_numbers_after_it_aligned(text, values):
    report = messages.DiagnosticStatus(1, text, "", text, {f"{i}{text}": text for i in range(values)})
    payload = messages.diagnostics(STAMP_NS, [report, report])
    status = STORE.deserialize_cdr(payload, TYPES[topics.DIAGNOSTICS]).status[1]
    assert (status.level, status.name, len(status.values)) == (1, text, values)


@given(st.lists(st.sampled_from("Bifd?"), max_size=12))
def test_numbers_may_be_written_together_or_one_by_one(letters):
    together, apart = CdrWriter(), CdrWriter()
    together.put("B", 1)
    apart.put("B", 1)
    together.put("".join(letters), *(1 for _ in letters))
    for letter in letters:
        apart.put(letter, 1)
    assert together.done() == apart.done()


@pytest.mark.parametrize("stamp_s", [2**31, 2**32 + 5, -(2**31) - 7])
def test_a_stamp_beyond_ros_2s_32_bits_is_their_last(stamp_s):
    assert messages.split_time(stamp_s * NS) == (2**31 - 1, 999_999_999)
    assert messages.split_time((2**31 - 1) * NS + 4) == (2**31 - 1, 4)
    assert messages.odometry(stamp_s * NS, 0.0, 0.0, 0.0, 0.0, 0.0)
