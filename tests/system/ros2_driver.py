"""A ROS 2 program without wallride that drives: zenoh-ros2-sdk publishes AckermannDriveStamped on /drive.

python ros2_driver.py ENDPOINT DOMAIN SECONDS SPEED STEERING
"""

import os
import sys
import time

ENDPOINT, DOMAIN, SECONDS, SPEED, STEERING = sys.argv[1], int(sys.argv[2]), *map(float, sys.argv[3:])
os.environ["ZENOH_CONFIG_OVERRIDE"] = f'mode="client";connect/endpoints=["{ENDPOINT}"];listen/endpoints=[]'

from zenoh_ros2_sdk import ROS2Publisher  # noqa: E402
from zenoh_ros2_sdk.session import ZenohSession  # noqa: E402
from zenoh_ros2_sdk.utils import get_type_hash  # noqa: E402

DRIVE = "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
STAMPED = "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
TIME = "int32 sec\nuint32 nanosec\n"
SCHEMA = "ackermann_msgs/msg/AckermannDriveStamped"
LINE = "=" * 80 + "\n"


def main():
    whole = (
        f"{STAMPED}{LINE}MSG: std_msgs/Header\n{HEADER}{LINE}MSG: builtin_interfaces/Time\n{TIME}"
        f"{LINE}MSG: ackermann_msgs/AckermannDrive\n{DRIVE}"
    )
    parts = {
        "ackermann_msgs/msg/AckermannDrive": DRIVE,
        "std_msgs/msg/Header": HEADER,
        "builtin_interfaces/msg/Time": TIME,
    }
    publisher = ROS2Publisher(
        "/drive", SCHEMA, msg_definition=whole, domain_id=DOMAIN, type_hash=get_type_hash(SCHEMA, STAMPED, parts)
    )
    types = ZenohSession.get_instance().store.types
    until_s = time.monotonic() + SECONDS
    while time.monotonic() < until_s:
        now_ns = time.time_ns()
        stamp = types["builtin_interfaces/msg/Time"](sec=now_ns // 10**9, nanosec=now_ns % 10**9)
        publisher.publish(
            header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="base_link"),
            drive=types["ackermann_msgs/msg/AckermannDrive"](
                steering_angle=STEERING, steering_angle_velocity=0.0, speed=SPEED, acceleration=0.0, jerk=0.0
            ),
        )
        time.sleep(0.02)
    os._exit(0)


main()
