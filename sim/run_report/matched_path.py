"""The path of a drive by its poses on a map, or by its scans laid upon each other as for a map.

The odometry alone draws every wall twice.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.wire import topics
from wallride.sim.mapping.closing import close_lap
from wallride.sim.mapping.lap_record import record_of_log
from wallride.sim.mapping.odometry_path import of_the_axle
from wallride.sim.mapping.pose_graph import between, placed
from wallride.sim.mapping.verdict import judge_map
from wallride.sim.recordings import RecordingError
from wallride.sim.replay.drive_log import DriveLog, decode
from wallride.sim.replay.run import DrivenPath, RecordedRun
from wallride.sim.world.pose import Floats

MAX_WAY_M: Final = 200.0
"""Longest way that is matched; each 60 m take some 2 s."""
UNTOLD_M: Final = 1.0
"""Longest way between two poses on the map, and before and after all."""


def told_path(log: DriveLog, run: RecordedRun) -> DrivenPath:
    """Return the run's path by its poses on a map, by matched scans, or where neither tells it by the odometry."""
    return _by_poses(log, run) or matched_path(log, run)


def _by_poses(log: DriveLog, run: RecordedRun) -> DrivenPath | None:
    path, poses = run.path, log.of(topics.POSE)
    if len(poses) < 2 or not len(path.time_s):
        return None
    rows = [(message.stamp_ns / NS - run.zero_unix_s, decode(message).pose.pose) for message in poses]
    time_s = np.array([at_s for at_s, _ in rows])
    way_m = np.cumsum(np.diff(path.time_s, prepend=path.time_s[:1]) * np.abs(path.speed_mps))
    between_m = np.diff(np.interp(time_s, path.time_s, way_m), prepend=0.0, append=way_m[-1])
    if between_m.max() > UNTOLD_M:
        return None
    places = [(at.position.x, at.position.y, 2 * math.atan2(at.orientation.z, at.orientation.w)) for _, at in rows]
    return _through(path, time_s, np.array(places), "poses on the map")


def _through(path: DrivenPath, time_s: Floats, poses: Floats, by: str) -> DrivenPath:
    poses[:, 2] = np.unwrap(poses[:, 2])
    x_m, y_m, yaw_rad = (np.interp(path.time_s, time_s, part) for part in poses.T)
    return replace(path, by=by, drifts=False, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


def matched_path(log: DriveLog, run: RecordedRun) -> DrivenPath:
    """Return the run's path with places by matched scans; as it is where they do not tell them, or the way is long."""
    path = run.path
    way_m = float(np.abs(np.diff(path.time_s, prepend=path.time_s[:1]) * path.speed_mps).sum())
    if not 0.0 < way_m <= MAX_WAY_M:
        return path
    try:
        record = record_of_log(log)
        lap = close_lap(record)
    except RecordingError:  # another program's, or hardly a drive
        return path
    if judge_map(record, lap, is_open=True).reasons:
        return path
    time_s = np.array([frame.time_s for frame in lap.frames]) + record.unix_s - run.zero_unix_s
    told = np.column_stack([path.x_m, path.y_m, path.yaw_rad])
    after_last = between(told[np.searchsorted(path.time_s[:-1], time_s[-1])], told[-1])  # no keyframe, but odometry
    axle = of_the_axle(lap.poses, record.lidar_m)
    axle = np.vstack([axle, placed(axle[-1], after_last)])
    time_s = np.append(time_s, max(path.time_s[-1], time_s[-1]))
    return _through(path, time_s, axle, "matched scans")
