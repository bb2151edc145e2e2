"""The beams of other lidars in the order that a car's have: counter-clockwise, each once, ahead in the middle.

The distances themselves stay as they were recorded.
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wallride.sim.recordings.recording import LidarTrack

MIN_TURN_STEPS = 8
"""Beams of a full turn from which on there is something to roll."""


def ahead_in_the_middle(lidar: LidarTrack) -> tuple[LidarTrack, list[str]]:
    """Return the lidar with its beams from right to left, and a note of what was done, [] for nothing."""
    notes = []
    if lidar.angle_step_rad < 0:
        last_rad = lidar.angle_min_rad + (lidar.ranges_m.shape[1] - 1) * lidar.angle_step_rad
        lidar = _with(lidar, lidar.ranges_m[:, ::-1], last_rad, -lidar.angle_step_rad)
        notes.append("its beams turn clockwise and are reversed")
    turn = round(math.tau / lidar.angle_step_rad)
    if turn < MIN_TURN_STEPS:
        return lidar, []
    if (more := lidar.ranges_m.shape[1] - turn) > 0:
        lidar = _with(lidar, lidar.ranges_m[:, :turn], lidar.angle_min_rad)
        notes.append(
            "its first and last beam are the same: one is left out" if more == 1 else f"{more} beams are double"
        )
    beams = lidar.ranges_m.shape[1]
    middle_rad = lidar.angle_min_rad + 0.5 * (beams - 1) * lidar.angle_step_rad
    first_rad = lidar.angle_min_rad - round(middle_rad / math.tau) * math.tau
    last_rad = first_rad + (beams - 1) * lidar.angle_step_rad
    half_rad = 0.5 * lidar.angle_step_rad
    gap_from_rad = math.pi - 0.5 * (turn - beams) * lidar.angle_step_rad  # either way from the fan's middle
    sees_ahead = abs(math.remainder(middle_rad, math.tau)) + math.pi / 2 <= gap_from_rad or beams == turn
    if sees_ahead and (first_rad < -math.pi - half_rad or last_rad > math.pi + half_rad):
        lidar = _rolled(lidar, turn)
        notes.append("its beams do not begin behind the car and are rolled so that ahead is in the middle")
    elif first_rad != lidar.angle_min_rad:
        lidar = replace(lidar, angle_min_rad=first_rad)
    return lidar, [f"{lidar.topic}: {'; '.join(notes)}."] if notes else []


def _rolled(lidar: LidarTrack, turn: int) -> LidarTrack:
    """Roll the beams of a turn, NaN where there are none, so that the first one points just behind the car."""
    missing = turn - lidar.ranges_m.shape[1]
    ranges_m = np.pad(lidar.ranges_m, ((0, 0), (0, missing)), constant_values=np.nan) if missing else lidar.ranges_m
    angles_rad = lidar.angle_min_rad + np.arange(turn) * lidar.angle_step_rad
    wrapped_rad = np.mod(angles_rad + math.pi + 1e-6, math.tau) - math.pi - 1e-6
    first = int(np.argmin(wrapped_rad))
    return _with(lidar, np.roll(ranges_m, -first, axis=1), float(wrapped_rad[first]))


def _with(
    lidar: LidarTrack, ranges_m: npt.NDArray[np.float32], first_rad: float, step_rad: float | None = None
) -> LidarTrack:
    step_rad = lidar.angle_step_rad if step_rad is None else step_rad
    return replace(lidar, ranges_m=ranges_m, angle_min_rad=first_rad, angle_step_rad=step_rad)
