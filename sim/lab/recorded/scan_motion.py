"""Scan-matching odometry of a recording; see `wallride.runtime.calibration.scan_motion`."""

import numpy as np

from wallride.runtime.calibration.scan_motion import ScanMotion, motion_of_scans
from wallride.runtime.control.perception.geometry import bearings_rad
from wallride.sim.recordings import Recording
from wallride.sim.world.pose import Floats


def motion_of(recording: Recording) -> ScanMotion:
    """Return the motion of a recording's lidar."""
    kind = (recording.angle_min_rad, recording.angle_step_rad, recording.beams)
    return motion_of_scans(recording.stamp_s, recording.ranges_m, kind, recording.range_max_m)


def bearing_deg(recording: Recording) -> Floats:
    """Return the bearing of every beam, (beams,), degrees."""
    return np.degrees(bearings_rad(recording.angle_min_rad, recording.angle_step_rad, recording.beams))
