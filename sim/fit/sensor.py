"""The lidar of a recording: noise, outliers and lost beams, and what of the car it sees."""

from dataclasses import dataclass

import numpy as np

from wallride.runtime.calibration.near_parts import SIGMA_PER_MAD, near_parts_m, sectors
from wallride.sim.recordings import Recording
from wallride.sim.world.own_parts import OWN_PARTS, profile
from wallride.sim.world.pose import Booleans, Floats

MAX_RANGE_M = 8.0
SMOOTH_M = 0.1
"""Maximum difference of neighbouring beams on one surface."""
OUTLIER_M = 0.5
TRIMMED_STDS = 3.0
MIN_STEP_M = 1e-3
SECOND_DIFFERENCE = np.sqrt(6.0)
"""Standard deviation of a - 2 b + c over that of each, for independent noise."""
MIN_SCANS = 40
MIN_MOVED_M = 0.3
MATCH_M = 0.1


@dataclass(frozen=True, slots=True)
class SensorFit:
    """noise_std_m: of a range. outlier_share: beams far from both neighbours and from both scans around.

    dropout_share: beams without a return between returns. parts: (from_deg, to_deg, range_m) of the car's own parts;
    part_kind: the simulator's kind that explains most of them; part_share: share of their beams that it explains.
    why: reason why own parts cannot be told.
    """

    noise_std_m: float
    outlier_share: float
    dropout_share: float
    parts: tuple[tuple[float, float, float], ...]
    part_kind: str
    part_share: float
    why: str = ""


def fit_sensor(recording: Recording, moved_m: float) -> SensorFit:
    """Return the lidar's faults. moved_m: way driven; at a standstill everything is fixed to the car."""
    ranges_m = recording.ranges_m.astype(np.float64)
    echo = (ranges_m > max(recording.range_min_m, 0.02)) & (ranges_m < recording.range_max_m)
    noise_m = _noise_m(ranges_m, echo)
    outliers, dropouts = _spikes(ranges_m, echo)
    if moved_m < MIN_MOVED_M or len(recording) < MIN_SCANS:
        return SensorFit(noise_m, outliers, dropouts, (), "none", 0.0, "the car stood: own parts are told by driving")
    fan = recording.angle_min_rad, recording.angle_step_rad, recording.beams
    part_m = near_parts_m(ranges_m, fan, max(recording.range_min_m, 0.02))
    kind, share = _kind(recording, part_m)
    return SensorFit(noise_m, outliers, dropouts, sectors(part_m, fan), kind, share)


def _noise_m(ranges_m: Floats, echo: Booleans) -> float:
    """Return the noise by second differences along smooth surfaces, which bend little over three beams."""
    near = echo & (ranges_m < MAX_RANGE_M)
    smooth = near[:, :-2] & near[:, 1:-1] & near[:, 2:]
    smooth &= (np.abs(np.diff(ranges_m[:, :-1])) < SMOOTH_M) & (np.abs(np.diff(ranges_m[:, 1:])) < SMOOTH_M)
    bend_m = (ranges_m[:, :-2] - 2.0 * ranges_m[:, 1:-1] + ranges_m[:, 2:])[smooth]
    if not bend_m.size:
        return np.nan
    std_m = SIGMA_PER_MAD * max(float(np.median(np.abs(bend_m))), MIN_STEP_M)  # whole millimetres
    return float(np.std(bend_m[np.abs(bend_m) < TRIMMED_STDS * std_m]) / SECOND_DIFFERENCE)


def _spikes(ranges_m: Floats, echo: Booleans) -> tuple[float, float]:
    """Return the shares of outliers and of lost beams among beams whose four neighbours agree."""
    middle, around = (slice(1, -1), slice(1, -1)), ((0, 1), (2, 1), (1, 0), (1, 2))
    rows, beams = ranges_m.shape
    if rows < 3 or beams < 3:
        return np.nan, np.nan
    beside = np.array([ranges_m[a : rows - 2 + a, b : beams - 2 + b] for a, b in around])
    agree = np.logical_and.reduce([echo[a : rows - 2 + a, b : beams - 2 + b] for a, b in around])
    agree &= np.ptp(beside, axis=0) < SMOOTH_M
    count = max(int(np.count_nonzero(agree)), 1)
    far = agree & echo[middle] & (np.abs(ranges_m[middle] - beside.mean(axis=0)) > OUTLIER_M)
    lost = agree & ~echo[middle]
    return float(np.count_nonzero(far) / count), float(np.count_nonzero(lost) / count)


def _kind(recording: Recording, part_m: Floats) -> tuple[str, float]:
    """Return the simulator's kind of own parts that is nearest, and the share of beams in which both agree."""
    found = np.isfinite(part_m)
    if not found.any():
        return "none", 1.0
    deg = np.degrees(recording.angle_min_rad + recording.angle_step_rad * np.arange(recording.beams))
    shares = {}
    for kind in OWN_PARTS:
        there_m = profile(kind, float(deg[0]), float(deg[-1]), recording.beams).range_m
        either = found | np.isfinite(there_m)
        with np.errstate(invalid="ignore"):
            shares[kind] = float(np.count_nonzero(np.abs(there_m - part_m) < MATCH_M) / np.count_nonzero(either))
    best = max(shares, key=lambda kind: shares[kind])
    return (best, shares[best]) if shares[best] > 0.0 else ("none", 0.0)
