"""One message of every type, with values that can be recognised, and the judges that did not come from wallride."""

import math

import numpy as np
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.ros import markers, messages
from wallride.runtime.ros.definitions import SCHEMA_ENCODING, definition
from wallride.runtime.wire import topics

STAMP_NS = 1_790_000_000_123_456_789
RANGES_M = np.where(np.arange(1081) % 7 == 0, np.nan, np.linspace(1, 9, 1081)).astype(np.float32)
SCAN = Scan(10.0, 10.001, -2.3562, 0.0043633, 0.02, 30.0, RANGES_M, 3)
MOTOR = MotorState(10.0, 1.5, 12.25, -0.1, 11.8, 6.5, 2.25, 31.0, "", False, False)
CELLS = np.array([[-1, 0, 100, 0, -1], [-1, 0, 0, 100, 100]], dtype=np.int8)
LINES = np.array([[0.0, 1.0, 2.0], [0.5, 0.25, -0.5]])

SAMPLES = {
    topics.SCAN: messages.laser_scan(STAMP_NS, SCAN, 0.025),
    topics.ODOM: messages.odometry(STAMP_NS, 1.0, -2.0, 0.5, 1.5, 0.25),
    topics.POSE: messages.pose(STAMP_NS, 1.0, -2.0, 0.5, 0.25, 0.125),
    topics.MAP: messages.occupancy_grid(STAMP_NS, CELLS, 0.05, (-1.0, -2.0, 0.5)),
    topics.LINE: messages.path(STAMP_NS, [(0.0, 1.0, -2.0, 0.5), (0.25, 2.0, -1.5, 0.25), (0.5, 2.5, 0.0, -0.25)]),
    topics.NAVIGATION: messages.ackermann(STAMP_NS, 2.0, -0.125),
    topics.SAFETY: messages.ackermann(STAMP_NS, 0.5, -0.125),
    topics.TELEOP: messages.ackermann(STAMP_NS, -0.5, 0.25),
    topics.OUTPUT: messages.ackermann(STAMP_NS, 1.75, 0.0625),
    topics.DISTANCE_ERROR: messages.float32(-0.125),
    topics.WALL: markers.marker_array(
        STAMP_NS, [markers.Marker("wall", markers.MarkerType.LINE_STRIP, LINES, markers.GREEN)]
    ),
    topics.FOOTPRINT: markers.marker_array(
        STAMP_NS,
        [
            markers.Marker("way", markers.MarkerType.LINE_LIST, LINES, markers.BLUE, 0.5),
            markers.Marker("empty", markers.MarkerType.POINTS, np.empty((2, 0)), markers.RED),
        ],
    ),
    topics.IMU: messages.imu(STAMP_NS, (0.1, 0.2, 0.3), (1.0, 2.0, 9.81)),
    topics.MOTOR: messages.motor(STAMP_NS, MOTOR),
    topics.JOY: messages.joy(STAMP_NS, (0.0, 0.5, 1.0), (0, 1)),
    topics.BATTERY: messages.battery(STAMP_NS, 11.5, 2.25),
    topics.DIAGNOSTICS: messages.diagnostics(
        STAMP_NS,
        [
            messages.DiagnosticStatus(0, "lidar", "UST-10LX, 1081 beams", "H123", {"checksum": "1", "stale": "22"}),
            messages.DiagnosticStatus(2, "motor", "Übertemperatur", "", {}),
        ],
    ),
    topics.TF: messages.transforms(
        STAMP_NS,
        [
            messages.Frame("odom", "base_link", 1.0, 2.0, math.pi / 2),
            messages.Frame("base_link", "laser", 0.25, 0.0, 0.0),
        ],
    ),
}


def ros_store(which=Stores.ROS2_JAZZY):
    """Return rosbags' types, with the one package that no store has."""
    store = get_typestore(which)
    numbers = (
        "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
    )
    store.register(
        {
            **get_types_from_msg(numbers, "ackermann_msgs/msg/AckermannDrive"),
            **get_types_from_msg(
                "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n",
                "ackermann_msgs/msg/AckermannDriveStamped",
            ),
        }
    )
    return store


def read_as_foxglove_does(schema, payload):
    """Decode with mcap-ros2-support, by the definition text that wallride hands to recorders."""
    record = Schema(id=1, name=schema, encoding=SCHEMA_ENCODING, data=definition(schema).encode())
    decode = DecoderFactory().decoder_for("cdr", record)
    assert decode is not None
    return decode(payload)
