"""Collector of ROS messages of the three types that playback needs, topic by topic, into tracks."""

import math
from collections import Counter, defaultdict
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.sim.recordings.recording import CommandTrack, LidarTrack, OdometryTrack, plain_name
from wallride.sim.recordings.tracks import Tracks, columns

LASER_SCAN = "sensor_msgs/msg/LaserScan"
ACKERMANN = "ackermann_msgs/msg/AckermannDriveStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
WANTED_TYPES = frozenset({LASER_SCAN, ACKERMANN, ODOMETRY})

ACKERMANN_DRIVE = "ackermann_msgs/msg/AckermannDrive"
ACKERMANN_DEFINITIONS = {
    ACKERMANN_DRIVE: (
        "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
    ),
    ACKERMANN: "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n",
}
"""Definitions of ackermann_msgs, which no distribution's type store has, and ROS 2 bags before Iron hold none."""

NANOSECOND_S = 1e-9


@dataclass(slots=True)
class Collector:
    """Collects messages as rows per topic; `received_ns` is the recorder's time since 1970.

    unreadable: messages per topic that did not decode; encodings: of those that are in none of ROS's. is_ours: whether
        wallride made the recording.
    """

    unreadable: Counter[str] = field(default_factory=Counter)
    encodings: dict[str, str] = field(default_factory=dict)
    is_ours: bool = False
    scans_by_topic: dict[str, list[tuple[int, Any]]] = field(default_factory=lambda: defaultdict(list))
    commands: dict[str, list[tuple[float, ...]]] = field(default_factory=lambda: defaultdict(list))
    odometries: dict[str, list[tuple[float, ...]]] = field(default_factory=lambda: defaultdict(list))

    def add(self, topic: str, message_type: str, received_ns: int, message: Any) -> None:  # noqa: ANN401 - built at run time by the type store
        """Keep the fields that playback needs of one message of one of the wanted types."""
        received_s = received_ns * NANOSECOND_S
        if message_type == LASER_SCAN:
            self.scans_by_topic[topic].append((received_ns, message))
        elif message_type == ACKERMANN:
            drive = message.drive
            self.commands[plain_name(topic)].append((received_s, drive.speed, drive.steering_angle))
        else:
            pose, twist = message.pose.pose, message.twist.twist
            yaw_rad = _yaw_rad(pose.orientation)
            row = (received_s, pose.position.x, pose.position.y, yaw_rad)
            self.odometries[plain_name(topic)].append((*row, twist.linear.x, twist.linear.y, twist.angular.z))

    @property
    def scans(self) -> int:
        """Return the number of scans on all topics."""
        return sum(len(scans) for scans in self.scans_by_topic.values())

    def extend(self, other: "Collector") -> None:
        """Take all that another one collected."""
        self.is_ours |= other.is_ours
        self.unreadable += other.unreadable
        self.encodings |= other.encodings
        for topic, scans in other.scans_by_topic.items():
            self.scans_by_topic[topic] += scans
        for topic, rows in other.commands.items():
            self.commands[topic] += rows
        for topic, rows in other.odometries.items():
            self.odometries[topic] += rows

    def tracks(self) -> Tracks:
        """Return all collected messages as tracks, with notes about omissions."""
        tracks = Tracks()
        for topic, count in sorted(self.unreadable.items()):
            encoding = f" ({self.encodings[topic]})" if topic in self.encodings else ""
            tracks.notes.append(f"{count} messages on {topic} could not be decoded{encoding} and are left out.")
        for topic, scans in self.scans_by_topic.items():
            lidar, note = _lidar(topic, scans, is_ours=self.is_ours)
            tracks.lidars[plain_name(topic)] = lidar
            tracks.notes.extend(note)
        for topic, rows in self.commands.items():
            tracks.commands[topic] = CommandTrack(*columns(sorted(rows), 3))
        for topic, rows in self.odometries.items():
            tracks.odometries[topic] = OdometryTrack(*columns(sorted(rows), 7))
        return tracks


def _lidar(topic: str, scans: list[tuple[int, Any]], *, is_ours: bool) -> tuple[LidarTrack, list[str]]:
    """Stack the scans of the fan that most scans have; another lidar on the same topic may have another fan."""
    fans = Counter(_fan(message) for _, message in scans)
    fan, kept = fans.most_common(1)[0]
    same = [(received_ns, message) for received_ns, message in scans if _fan(message) == fan]
    notes = []
    if kept < len(scans):
        notes.append(f"{len(scans) - kept} scans on {topic} have other beams than the other {kept} and are left out.")
    first = same[0][1]
    turn_s, step_rad = float(first.scan_time), float(first.angle_increment)
    if is_ours:  # its driver may have taken the motion out; and its first scan knows no other before it
        turn_s = abs(float(first.time_increment) * math.tau / step_rad) if step_rad else 0.0
    ranges_m: npt.NDArray[np.float32] = np.stack([np.asarray(message.ranges, dtype=np.float32) for _, message in same])
    track = LidarTrack(
        topic=topic,
        received_s=np.array([received_ns * NANOSECOND_S for received_ns, _ in same]),
        stamp_s=np.array([_stamp_s(message) for _, message in same]),
        ranges_m=ranges_m,
        angle_min_rad=float(first.angle_min),
        angle_step_rad=step_rad,
        range_min_m=float(first.range_min),
        range_max_m=float(first.range_max),
        scan_time_s=turn_s,
    )
    if is_ours:  # its stamps are the last beams', ROS's the first ones'
        track = replace(track, stamp_s=track.stamp_s - track.sweep_s)
    return track, notes


def _fan(message: Any) -> tuple[int, float, float]:  # noqa: ANN401 - built at run time by the type store
    return len(message.ranges), float(message.angle_min), float(message.angle_increment)


def _stamp_s(message: Any) -> float:  # noqa: ANN401 - built at run time by the type store
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec * NANOSECOND_S)


def _yaw_rad(q: Any) -> float:  # noqa: ANN401 - built at run time by the type store
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
