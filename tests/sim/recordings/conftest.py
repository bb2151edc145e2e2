"""Recordings for these tests: real ones where they are, and small ones written on the spot in every format."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from wallride.sim.recordings.messages import ACKERMANN, ACKERMANN_DEFINITIONS, LASER_SCAN, ODOMETRY

Said = tuple[str, str, float, Any]
"""Topic, type, receive time in seconds, message."""


class Stage:
    """Makes messages of one ROS generation and writes them to files."""

    def __init__(self, store: Stores) -> None:
        self.store: Typestore = get_typestore(store)
        for name, definition in ACKERMANN_DEFINITIONS.items():
            self.store.register(get_types_from_msg(definition, name))
        self._is_ros1 = store is Stores.ROS1_NOETIC

    def header(self, stamp_s: float) -> Any:
        types = self.store.types
        time = types["builtin_interfaces/msg/Time"](sec=int(stamp_s), nanosec=round(stamp_s % 1 * 1e9))
        sequence = {"seq": 0} if self._is_ros1 else {}
        return types["std_msgs/msg/Header"](stamp=time, frame_id="laser", **sequence)

    def scan(self, received_s: float, ranges_m: list[float], topic: str = "/scan") -> Said:
        message = self.store.types[LASER_SCAN](
            header=self.header(received_s - 0.02),
            angle_min=-1.0,
            angle_max=1.0,
            angle_increment=0.5,
            time_increment=0.0,
            scan_time=0.025,
            range_min=0.02,
            range_max=30.0,
            ranges=np.array(ranges_m, dtype=np.float32),
            intensities=np.empty(0, dtype=np.float32),
        )
        return topic, LASER_SCAN, received_s, message

    def command(self, received_s: float, speed_mps: float, steering_rad: float, topic: str) -> Said:
        drive = self.store.types["ackermann_msgs/msg/AckermannDrive"](
            steering_angle=steering_rad, steering_angle_velocity=0.0, speed=speed_mps, acceleration=0.0, jerk=0.0
        )
        message = self.store.types[ACKERMANN](header=self.header(received_s), drive=drive)
        return topic, ACKERMANN, received_s, message

    def odometry(self, received_s: float, x_m: float, yaw_rad: float, vx_mps: float) -> Said:
        types = self.store.types
        vector, nothing = types["geometry_msgs/msg/Vector3"], np.zeros(36)
        pose = types["geometry_msgs/msg/Pose"](
            position=types["geometry_msgs/msg/Point"](x=x_m, y=-1.0, z=0.0),
            orientation=types["geometry_msgs/msg/Quaternion"](
                x=0.0, y=0.0, z=float(np.sin(yaw_rad / 2)), w=float(np.cos(yaw_rad / 2))
            ),
        )
        twist = types["geometry_msgs/msg/Twist"](
            linear=vector(x=vx_mps, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.5)
        )
        message = types[ODOMETRY](
            header=self.header(received_s),
            child_frame_id="base_link",
            pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=nothing),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=nothing),
        )
        return "/vesc/odom", ODOMETRY, received_s, message

    def write(self, path: Path, said: list[Said], plugin: StoragePlugin = StoragePlugin.SQLITE3) -> Path:
        """Write a .bag, or a ROS 2 folder of the plugin given; return the path of what `load_recording` takes."""
        if self._is_ros1:
            with Writer1(path) as bag:
                self._write(bag, said)
        else:
            with Writer2(path, version=9, storage_plugin=plugin) as folder:
                self._write(folder, said)
        return path

    def _write(self, writer: Writer1 | Writer2, said: list[Said]) -> None:
        connections: dict[str, Connection] = {}
        for topic, message_type, received_s, message in said:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message_type, typestore=self.store)
            serialize: Callable[..., Any] = self.store.serialize_ros1 if self._is_ros1 else self.store.serialize_cdr
            writer.write(connections[topic], round(received_s * 1e9), bytes(serialize(message, message_type)))


@pytest.fixture(scope="session")
def ros1() -> Stage:
    return Stage(Stores.ROS1_NOETIC)


@pytest.fixture(scope="session")
def ros2() -> Stage:
    return Stage(Stores.ROS2_HUMBLE)


def story(stage: Stage, scans: int = 5) -> list[Said]:
    """A short drive: a scan every 25 ms, a command before the first and between the others."""
    said = [stage.command(99.99, 1.0, 0.25, "/vesc/high_level/input/nav_0")]
    for number in range(scans):
        now_s = 100.0 + 0.025 * number
        said.append(stage.scan(now_s, [1.0 + number, 65.533, 0.004, np.inf, np.nan]))
        said.append(stage.command(now_s + 0.001, 0.0, -0.25, "/vesc/low_level/ackermann_cmd"))
        said.append(stage.odometry(now_s + 0.002, x_m=float(number), yaw_rad=0.5, vx_mps=1.5))
    return said


@pytest.fixture(scope="session")
def ros1_story(ros1: Stage) -> list[Said]:
    return story(ros1)


@pytest.fixture(scope="session")
def ros2_story(ros2: Stage) -> list[Said]:
    return story(ros2)
