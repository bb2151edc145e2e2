#!/usr/bin/python3
"""The report's nodes for rospy, written anew: `nodes.py wall_follower|safety|mux`. Needs Debian's python3-rospy.

A drive is a TwistStamped: linear.x [m/s], angular.z steering [rad]; its header's stamp is that of the scan it answers.
"""

import math
import sys
import time
from collections.abc import Callable

import numpy as np
import rospy
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import LaserScan

SPEED_MPS, DESIRED_M, KP, KD = 1.0, 1.0, 1.6, 1.5
NONSENSE_BELOW_M, CORNER_M, STOP_BELOW_M, SAFETY_HOLDS_S = 0.2, 2.0, 0.933, 0.2


def mean_of_three_nearest_m(ranges_m: np.ndarray) -> float:
    """Return the mean of the three smallest."""
    count = min(3, ranges_m.size)
    return float(np.partition(ranges_m, count - 1)[:count].mean())


def ahead_m(scan: LaserScan, ranges_m: np.ndarray) -> float:
    """Return the distance straight ahead."""
    middle = round(-scan.angle_min / scan.angle_increment)
    ahead = ranges_m[middle - 2 : middle + 3]
    ahead = ahead[ahead > NONSENSE_BELOW_M]
    return mean_of_three_nearest_m(ahead) if ahead.size else math.inf


def steering_rad(scan: LaserScan) -> float:
    """Return the steering of the report's law."""
    ranges_m = np.array(scan.ranges)
    first = round((0.1 * math.pi - scan.angle_min) / scan.angle_increment)
    last = round((0.6 * math.pi - scan.angle_min) / scan.angle_increment)
    side_m = ranges_m[first : last + 1]
    angles_rad = scan.angle_min + np.arange(first, last + 1) * scan.angle_increment
    usable = side_m > NONSENSE_BELOW_M
    side_m, angles_rad = side_m[usable], angles_rad[usable]
    if side_m.size < 3:
        return 0.0
    x_m, y_m = side_m * np.cos(angles_rad), side_m * np.sin(angles_rad)
    x_m, y_m = x_m - x_m.mean(), y_m - y_m.mean()
    angle_rad, distance_m = math.atan(float(x_m @ y_m) / float(x_m @ x_m)), mean_of_three_nearest_m(side_m)
    front_m = ahead_m(scan, ranges_m)
    if front_m <= CORNER_M:
        distance_m = front_m / 2
    return 0.0 if abs(angle_rad) > math.pi / 3 else KD * angle_rad + KP * (distance_m - DESIRED_M)


def drive(scan: LaserScan, speed_mps: float, steering_rad: float) -> TwistStamped:
    """Return a drive that answers this scan."""
    message = TwistStamped()
    message.header.stamp = scan.header.stamp
    message.twist.linear.x = speed_mps
    message.twist.angular.z = steering_rad
    return message


class Node:
    """One of the three nodes."""

    def __init__(self, role: str) -> None:
        rospy.init_node(role, anonymous=True)
        self._nodelay = bool(rospy.get_param("/tcp_nodelay", default=False))
        self._stopped_until_s = 0.0
        topic = {"wall_follower": "/navigation", "safety": "/safety", "mux": "/output"}[role]
        self._publisher = rospy.Publisher(topic, TwistStamped, queue_size=1)
        if role == "mux":
            self._hear("/navigation", TwistStamped, self._on_navigation)
            self._hear("/safety", TwistStamped, self._on_safety)
        else:
            self._hear("/scan", LaserScan, self._follow if role == "wall_follower" else self._guard)

    def _hear(self, topic: str, kind: type, callback: Callable) -> None:
        rospy.Subscriber(topic, kind, callback, queue_size=1, buff_size=1 << 20, tcp_nodelay=self._nodelay)

    def _follow(self, scan: LaserScan) -> None:
        self._publisher.publish(drive(scan, SPEED_MPS, steering_rad(scan)))

    def _guard(self, scan: LaserScan) -> None:
        if ahead_m(scan, np.array(scan.ranges)) < STOP_BELOW_M:
            self._publisher.publish(drive(scan, 0.0, 0.0))

    def _on_safety(self, stop: TwistStamped) -> None:
        self._stopped_until_s = time.monotonic() + SAFETY_HOLDS_S
        self._publisher.publish(stop)

    def _on_navigation(self, wish: TwistStamped) -> None:
        if time.monotonic() >= self._stopped_until_s:
            self._publisher.publish(wish)


if __name__ == "__main__":
    Node(sys.argv[1])
    rospy.spin()
