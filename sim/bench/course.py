"""Scans of a benchmark: a real simulated drive, encoded in advance, so that sending costs one copy.

Every second scan is taken SHIFT_M nearer to the wall, so that the right steering of two scans in a row is never the
same: the servo position identifies the scan that a command answers.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.sim.devices.scip_encode import SensorModel, encode_number, encode_samples, sum_character
from wallride.sim.lab.laws import build
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world

SHIFT_M: Final = 0.05
BOARD_AHEAD_M: Final = 0.30
"""Distance ahead of the lidar of the board, as wide as the car, that an onset shows suddenly."""
BOARD_HALF_WIDTH_M: Final = 0.2
SPEED_MPS: Final = 1.0
LAP_S: Final = 20.0
_LINE_CHARS: Final = 64
_SETTLED_S: Final = 3.0


@dataclass(frozen=True, slots=True)
class Picture:
    """One scan, encoded but for its stamp, and the speed of the wheels then."""

    samples: bytes
    speed_mps: float

    def block(self, echo: bytes, stamp_ms: int) -> bytes:
        """Return the reply of the sensor."""
        stamp = encode_number(stamp_ms % (1 << 24), 4)
        return b"%b\n99b\n%b%b\n%b\n\n" % (echo, stamp, sum_character(stamp), self.samples)


@dataclass(frozen=True, slots=True)
class BenchScans:
    """free: scans of a drive in a corridor with corners. blocked: the same with a board before the car."""

    model: SensorModel
    rate_hz: float
    free: tuple[Picture, ...]
    blocked: tuple[Picture, ...]
    ranges_mm: npt.NDArray[np.int32]
    """Ranges of the free scans and after them the blocked ones, for clients without SCIP: shape (2 n, beams)."""


def sensor(beams: int, rate_hz: float) -> SensorModel:
    """Return a UST-10LX with other numbers. beams: 1 more than a multiple of 6, so that one looks straight ahead."""
    if beams % 6 != 1 or beams < 7:
        raise ValueError(f"{beams} beams: take one more than a multiple of 6, for example 361, 1081 or 4321")
    last = beams - 1
    return SensorModel(
        "UST-10LX", 20, 30000, last * 4 // 3, 0, last, last // 2, round(60 * rate_hz), "bench", "1.1.8", "SCIP 2.2", "B"
    )


def make_course(beams: int = 1081, rate_hz: float = 40.0, scans: int = 800, *, blocked: bool = True) -> BenchScans:
    """Drive a simulated car with the default laws, and take the scans on its way; `scans` pictures of either kind."""
    lidar = LidarSettings(beams=beams, rate_hz=rate_hz)
    world = load_world("curved")
    follower, guard = build("ball", "left", 1.0, SPEED_MPS)
    run = drive(Case(world, distance_m=1e3, duration_s=_SETTLED_S + LAP_S), follower, guard)
    rng = np.random.default_rng(1)
    times_s = _SETTLED_S + np.arange(scans) / rate_hz % (LAP_S - 0.1)
    x_m, y_m, yaw_rad, speed_mps = (
        np.interp(times_s, run.time_s, column)
        for column in (run.pose[:, 0], run.pose[:, 1], np.unwrap(run.pose[:, 2]), run.speed_mps[:, 1])
    )
    board_mm = _board_mm(lidar)
    free: list[Picture] = []
    stopped: list[Picture] = []
    ranges_mm = np.empty((2 if blocked else 1, scans, beams), np.int32)
    for i in range(scans):
        side_m = SHIFT_M / 2 if i % 2 else -SHIFT_M / 2
        pose = Pose(
            float(x_m[i] - side_m * math.sin(yaw_rad[i])), float(y_m[i] + side_m * math.cos(yaw_rad[i])),
            float(yaw_rad[i]),
        )  # fmt: skip
        seen_mm = scan(world, pose, Twist(float(speed_mps[i])), i / rate_hz, rng, lidar)
        ranges_mm[0, i] = seen_mm
        free.append(Picture(_sample_lines(seen_mm), float(speed_mps[i])))
        if blocked:
            ranges_mm[1, i] = np.minimum(seen_mm, board_mm)
            stopped.append(Picture(_sample_lines(ranges_mm[1, i]), float(speed_mps[i])))
    return BenchScans(sensor(beams, rate_hz), rate_hz, tuple(free), tuple(stopped), ranges_mm.reshape(-1, beams))


def _board_mm(lidar: LidarSettings) -> npt.NDArray[np.int32]:
    """Return the ranges to a board across the way, and values beyond any lidar's range beside it."""
    bearing_rad = np.radians(np.linspace(lidar.first_deg, lidar.last_deg, lidar.beams))
    hit = np.abs(bearing_rad) < math.atan2(BOARD_HALF_WIDTH_M, BOARD_AHEAD_M)
    return np.where(hit, 1000 * BOARD_AHEAD_M / np.cos(np.where(hit, bearing_rad, 0.0)), 1 << 17).astype(np.int32)


def _sample_lines(ranges_mm: npt.NDArray[np.integer]) -> bytes:
    samples = encode_samples(ranges_mm, 3)
    cut = (samples[at : at + _LINE_CHARS] for at in range(0, len(samples), _LINE_CHARS))
    return b"\n".join(line + sum_character(line) for line in cut)
