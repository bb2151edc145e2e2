"""Interferences of safety with a recorded drive, and their justification by the rest of the recording.

An episode is a sequence of scans at which the car would have had to go slower than it did. The recording shows what
became of the car that went on: whether it came close, whether it was stopped there, or whether it passed with room to
spare, so that the interference was needless.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from benchmarks.lab.recorded.replay import JudgedScan, Replay
from wallride.runtime.calibration.scan_motion import ScanMotion
from wallride.runtime.control.perception.view import BODY_BEYOND_RAD
from wallride.runtime.control.perception.window_dirt import SMUDGE_NEARER_THAN_M
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.world.pose import Floats

SAME_EPISODE_S = 0.3
LOOKS_ON_S = 1.0
CLOSE_M = 0.05
"""Clearance to the car's bare outline below which braking was justified: it is the law's own margin."""
STANDS_BELOW_MPS = 0.1

Outcome = Literal["came close", "was stopped", "passed"]


@dataclass(frozen=True, slots=True)
class Episode:
    """first, last: scans. stop: a stop, not only a cap. room_m: minimum clearance of the outline afterwards.

    way_m: the way that safety saw before it. worst: the scan of the lowest allowed speed.
    """

    first: int
    last: int
    worst: int
    stop: bool
    reason: str
    speed_mps: float
    allowed_mps: float
    way_m: float
    room_m: float
    outcome: Outcome


def episodes(done: Replay) -> list[Episode]:
    """Return every interference, in order."""
    rows: list[list[JudgedScan]] = []
    for judged in done.judged:
        if not judged.capped:
            continue
        if rows and judged.scan.stamp_s - rows[-1][-1].scan.stamp_s < SAME_EPISODE_S:
            rows[-1].append(judged)
        else:
            rows.append([judged])
    return [_episode(done, row) for row in rows]


def _episode(done: Replay, row: list[JudgedScan]) -> Episode:
    worst = min(row, key=lambda judged: judged.verdict.forward_mps)
    number = worst.scan.sequence
    room_m = room_along_m(done.motion, done.judged, number)
    return Episode(
        row[0].scan.sequence,
        row[-1].scan.sequence,
        number,
        worst.stopped,
        worst.verdict.reason,
        worst.motor.speed_mps,
        worst.verdict.forward_mps,
        worst.verdict.measure,
        room_m,
        _outcome(done, number, room_m),
    )


def _outcome(done: Replay, number: int, room_m: float) -> Outcome:
    if room_m < CLOSE_M:
        return "came close"
    ahead = _next(done.judged, number)
    if any(abs(done.judged[scan].motor.speed_mps) < STANDS_BELOW_MPS for scan in ahead):
        return "was stopped"
    return "passed"


def _next(judged: list[JudgedScan], number: int) -> list[int]:
    """Return the scans of the next second, without those behind a gap."""
    begun_s, scans = judged[number].scan.stamp_s, []
    for scan in range(number, len(judged)):
        if not 0.0 <= judged[scan].scan.stamp_s - begun_s <= LOOKS_ON_S:
            break
        scans.append(scan)
    return scans


def room_along_m(motion: ScanMotion, judged: list[JudgedScan], number: int) -> float:
    """Return the minimum clearance of the car's bare outline to a scan's points on the way that it really took."""
    view, car = judged[number].assessment.view, CarSettings()
    # Points this near behind the lidar move with the car: its own parts, or dirt.
    real = view.solid & ((np.abs(view.bearing_rad) < BODY_BEYOND_RAD) | (view.ranges_m > SMUDGE_NEARER_THAN_M))
    points_m = np.stack([view.x_m[real], view.y_m[real]])
    if not points_m.size:
        return math.inf
    return min(_room_m(_seen_from(motion, number, scan, points_m, car), car) for scan in _next(judged, number))


def _seen_from(motion: ScanMotion, number: int, scan: int, points_m: Floats, car: CarSettings) -> Floats:
    """Return points in base_link at one scan, seen from base_link at another."""
    turned_rad = float(motion.yaw_rad[scan] - motion.yaw_rad[number])
    cos, sin = math.cos(motion.yaw_rad[number]), math.sin(motion.yaw_rad[number])
    dx, dy = motion.x_m[scan] - motion.x_m[number], motion.y_m[scan] - motion.y_m[number]
    ahead_m, left_m = cos * dx + sin * dy, cos * dy - sin * dx
    x_m, y_m = points_m[0] - car.lidar_x_m - ahead_m, points_m[1] - left_m
    cos, sin = math.cos(turned_rad), math.sin(turned_rad)
    return np.stack([cos * x_m + sin * y_m + car.lidar_x_m, cos * y_m - sin * x_m])


def _room_m(points_m: Floats, car: CarSettings) -> float:
    """Return the third smallest distance to the outline: two points alone are noise."""
    ahead_m = np.maximum(np.maximum(points_m[0] - car.front_m, -car.rear_m - points_m[0]), 0.0)
    aside_m = np.maximum(np.abs(points_m[1]) - car.half_width_m, 0.0)
    distances_m = np.hypot(ahead_m, aside_m)
    third = min(2, distances_m.size - 1)
    return float(np.partition(distances_m, third)[third])
