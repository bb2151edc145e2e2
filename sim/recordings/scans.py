"""Recordings of any program as the car would have had them: scans, motion, the side of the wall that is seen better."""

from typing import Literal

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.calibration.scan_motion import ScanMotion, motion_of_scans
from wallride.runtime.control.perception.view import View, ViewCache
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.followed_wall import side_view
from wallride.runtime.control.wall_following.wall_fit import WallLine
from wallride.sim.recordings.recording import Recording

MAX_AGE_S = 0.2
"""Maximum age of a scan; older ones reached the recorder late, not the car's own program."""
FOREIGN_SHARE = 0.05
"""Minimum share of stamps that jump back at which several lidars publish on one topic; less is a hiccup."""


def is_foreign(recording: Recording) -> bool:
    """Return whether the scans of several lidars are mixed."""
    return bool(len(recording) > 1 and np.mean(np.diff(recording.stamp_s) < 0) > FOREIGN_SHARE)


def scans_of(recording: Recording) -> list[Scan]:
    """Return the scans as the car's driver would deliver them: NaN for invalid distances."""
    ranges_m = np.asarray(recording.ranges_m)
    usable = (ranges_m >= recording.range_min_m) & (ranges_m <= recording.range_max_m)
    clean_m = np.where(usable, ranges_m, np.float32(np.nan)).astype(np.float32)
    clean_m.setflags(write=False)
    scans = []
    for number in range(len(recording)):
        stamp_s = float(recording.stamp_s[number])
        age_s = min(max(float(recording.received_s[number]) - stamp_s, 0.0), MAX_AGE_S)
        scans.append(
            Scan(
                stamp_s, stamp_s + age_s, recording.angle_min_rad, recording.angle_step_rad, recording.range_min_m,
                recording.range_max_m, clean_m[number], number,
            )
        )  # fmt: skip
    return scans


def motion_of(recording: Recording) -> ScanMotion:
    """Return the motion of a recording's lidar, from its scans alone."""
    kind = (recording.angle_min_rad, recording.angle_step_rad, recording.beams)
    return motion_of_scans(recording.stamp_s, recording.ranges_m, kind, recording.range_max_m)


def motor_at(motion: ScanMotion, number: int, wheels_rad: float, time_s: float) -> MotorState:
    """Return the motor state that a controller would have reported: the speed that the scans show, and the way."""
    speed_mps = float(motion.speed_mps[number])
    if abs(speed_mps) < 0.05:
        speed_mps = 0.0  # noise of the scans; a standing wheel reports 0
    way_m = float(motion.way_m[number])
    return MotorState(time_s, speed_mps, way_m, wheels_rad, 11.0, 0.0, 0.0, 25.0)


def wall_line(view: View, side: Literal["left", "right"]) -> WallLine | None:
    """Return the wall's line on one side, as the follower finds it."""
    seen = side_view(view, side)
    return seen.side.lines.find(seen.x_m, seen.y_m, seen.range_m, seen.solid)


def better_side(recording: Recording) -> Literal["left", "right"]:
    """Return the side whose wall is seen with more beams, over every tenth scan."""
    eyes = ViewCache(CarSettings())
    inliers = {"left": 0, "right": 0}
    for scan in scans_of(recording)[::10]:
        view = eyes.see(scan)
        for side in ("left", "right"):
            line = wall_line(view, side)
            inliers[side] += line.inliers if line is not None else 0
    return "left" if inliers["left"] >= inliers["right"] else "right"
