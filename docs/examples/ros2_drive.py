"""Drive through ROS 2's /drive without ROS: python ros2_drive.py ENDPOINT SECONDS SPEED_MPS STEERING_RAD.

Needs zenoh-ros2-sdk (pip install zenoh-ros2-sdk), and ros2.enabled, ros2.drive and planners.enabled on the car;
ROS_DOMAIN_ID is its ros2.domain. Without `msg_definition` and `type_hash` the SDK fetches them from the internet.
"""

import os
import sys
import time

endpoint, seconds, speed_mps, steering_rad = sys.argv[1], *map(float, sys.argv[2:])
os.environ["ZENOH_CONFIG_OVERRIDE"] = f'mode="client";connect/endpoints=["{endpoint}"];listen/endpoints=[]'

from zenoh_ros2_sdk import ROS2Publisher  # noqa: E402 - it reads the override when it is imported
from zenoh_ros2_sdk.session import ZenohSession  # noqa: E402

TYPE = "ackermann_msgs/msg/AckermannDriveStamped"
HASH = "RIHS01_48ca7612a08d3bb72744fd98b71b7cf2ea24c6ad50fa4e1aa0bbad963c90d8cf"
NEXT = "=" * 80 + "\nMSG: "
DEFINITION = (
    "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n"
    f"{NEXT}std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{NEXT}builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    f"{NEXT}ackermann_msgs/AckermannDrive\nfloat32 steering_angle\nfloat32 steering_angle_velocity\n"
    "float32 speed\nfloat32 acceleration\nfloat32 jerk\n"
)

publisher = ROS2Publisher("/drive", TYPE, msg_definition=DEFINITION, type_hash=HASH)
types = ZenohSession.get_instance().store.types
until_s = time.monotonic() + seconds
while time.monotonic() < until_s:
    sec, nanosec = divmod(time.time_ns(), 10**9)  # better: the stamp of the scan that this answers
    stamp = types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="base_link")
    drive = types["ackermann_msgs/msg/AckermannDrive"](
        steering_angle=steering_rad, steering_angle_velocity=0.0, speed=speed_mps, acceleration=0.0, jerk=0.0
    )
    publisher.publish(header=header, drive=drive)
    time.sleep(0.02)  # 20 Hz or more; the first 0.5 s only serve to compare clocks
publisher.close()
ZenohSession.get_instance().session.close()
