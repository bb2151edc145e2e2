"""Error of the odometry over WAY_M against the truth, with a gyro and without one.

Run: python -m benchmarks.racing.odometry --data DATA

The drives are those of `benchmarks.racing.maps`: a lap along the wall, wheels that report 3 % too much, a steering trim
of 0.02 rad, a gyro with bias, noise and a scale 1 % wrong, after 2 s of standing. "gyro and scans" knows none of these
errors at first. "of turn" is the error of the heading that grows with the turn, in WAY_M; "of lap" the error at the
lap's end over the right angles between its ends, to which the bias of the gyro contributes. Exit code 1 where "gyro and
scans" does not hold.
"""

import argparse
import math
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple, dataclass, replace
from functools import reduce
from pathlib import Path

import numpy as np

from benchmarks.racing.maps import MAPS, TRACKS, MapDrive, recorded
from wallride.drivers.api import MotorState
from wallride.runtime.control.localization.gyro_odometry import GyroOdometry
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.mapping.poses import moments
from wallride.sim.races.mapped_lap import GYRO_BIAS_RADPS, GYRO_SCALE, WHEELS
from wallride.sim.world.pose import Floats

WAY_M, RMS_M, RMS_DEG, OF_TURN = 10.0, 0.20, 1.2, 0.01
SPEEDS_MPS, FRICTIONS = (2.0, 4.0), (0.8, 0.5)
GRAVITY = (0.0, 0.0, 9.81)


@dataclass(frozen=True, slots=True)
class SensorsUsed:
    """What the odometry is given. by_map: the scale of the wheels."""

    gyro: bool = True
    scans: bool = True
    by_map: bool = False


BY_SCANS, BY_MAP = "gyro and scans", "gyro, on a map"
KINDS = {
    "steering": SensorsUsed(gyro=False),
    "gyro": SensorsUsed(scans=False),
    BY_SCANS: SensorsUsed(),
    BY_MAP: SensorsUsed(by_map=True),
}


def path(record: LapRecord, kind: str) -> Floats:
    """Return the poses at the reports, time and x, y, yaw each, (n, 4)."""
    odometry, sensors = GyroOdometry(CarSettings()), KINDS[kind]
    if sensors.by_map:
        odometry.errors.know_scale(1.0 / WHEELS)
    samples = iter(record.gyro.tolist() if sensors.gyro else ())
    scans = (scan for scan, _ in moments(record)) if sensors.scans else iter(())
    sample, scan, found = next(samples, None), next(scans, None), []
    for time_s, way_m, speed_mps, steering_rad in record.reports.tolist():
        while scan is not None and scan.stamp_s < time_s:
            odometry.learn(scan)
            scan = next(scans, None)
        while sample is not None and sample[0] <= time_s:
            odometry.take(sample[0], (0.0, 0.0, sample[1]), GRAVITY)
            sample = next(samples, None)
        pose = odometry.update(MotorState(time_s, speed_mps, way_m, steering_rad))
        found.append((time_s, pose.x_m, pose.y_m, pose.yaw_rad))
    return np.array(found)


@dataclass(frozen=True, slots=True)
class OdometryError:
    """Rms of position and heading after WAY_M, and shares of the turn in that and in the lap."""

    position_m: float
    heading_deg: float
    of_turn: float
    of_lap: float

    def worse(self, other: "OdometryError") -> "OdometryError":
        """Return the larger of each figure."""
        return OdometryError(*(max(pair) for pair in zip(astuple(self), astuple(other), strict=True)))


def errors(record: LapRecord, truth: Floats, told: Floats) -> OdometryError:
    """Return the errors of poses with their times (n, 4). truth: the poses at the scans."""
    yaw = np.unwrap(told[:, 3])
    at = np.column_stack([np.interp(record.scan_s, told[:, 0], part) for part in (told[:, 1], told[:, 2], yaw)])
    true = np.column_stack([truth[:, :2], np.unwrap(truth[:, 2])])
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T))])
    ends = np.searchsorted(way_m, way_m + WAY_M)
    begins = np.flatnonzero(ends < len(way_m))[::5]
    ends = ends[begins]
    moved = [
        ((poses[ends, 0] - poses[begins, 0]) + 1j * (poses[ends, 1] - poses[begins, 1]))
        * np.exp(-1j * poses[begins, 2])
        for poses in (at, true)
    ]
    turn = true[ends, 2] - true[begins, 2]
    off = (at[ends, 2] - at[begins, 2]) - turn
    lap = true[-1, 2] - true[0, 2]
    return OdometryError(
        float(np.sqrt(np.mean(np.abs(moved[0] - moved[1]) ** 2))),
        math.degrees(float(np.sqrt(np.mean(off**2)))),
        float(abs(off @ turn) / (turn @ turn)),
        abs(float(at[-1, 2] - at[0, 2] - lap)) / max(abs(float(lap)), math.pi / 2),
    )


def driven(drive: MapDrive, data: Path, gyro_scale: float) -> dict[str, OdometryError]:
    """Return the errors of one drive by kind. gyro_scale: of the turn that the gyro reports."""
    record, truth = recorded(drive, data)
    rates = record.gyro[:, 1] + (gyro_scale / GYRO_SCALE - 1.0) * (record.gyro[:, 1] - GYRO_BIAS_RADPS)
    record = replace(record, gyro=np.column_stack([record.gyro[:, 0], rates]))
    return {kind: errors(record, truth, path(record, kind)) for kind in KINDS}


def shown(name: str, kind: str, error: OdometryError) -> str:
    """Return a row of the table."""
    return (
        f"{name:34}{kind:16}{error.position_m:11.3f}{error.heading_deg:12.2f}{error.of_turn:10.2%}{error.of_lap:10.2%}"
    )


def options_of() -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=11000)
    parser.add_argument("--mu", type=float, nargs=2, default=FRICTIONS, help="friction at 2 m/s, and at 4 m/s")
    parser.add_argument("--gyro-scale", type=float, default=GYRO_SCALE)
    return parser.parse_args()


def main() -> None:
    """Print a line for each drive and kind, then median and worst at each speed."""
    options = options_of()
    drives = [
        MapDrive(place, speed_mps, mu, options.seed + number, gyro=True)
        for number, place in enumerate((*MAPS, *TRACKS))
        for speed_mps, mu in zip(SPEEDS_MPS, options.mu, strict=True)
    ]
    found: dict[tuple[str, float], list[OdometryError]] = {}
    print(f"{'drive':34}{'kind':16}{'position m':>11}{'heading deg':>12}{'of turn':>10}{'of lap':>10}")
    with ProcessPoolExecutor() as pool:
        count = len(drives)
        told = pool.map(driven, drives, [options.data] * count, [options.gyro_scale] * count)
        for drive, of_kind in zip(drives, told, strict=True):
            for kind, error in of_kind.items():
                print(shown(f"{drive.place}, {drive.speed_mps:g} m/s, mu {drive.mu:g}", kind, error), flush=True)
                found.setdefault((kind, drive.speed_mps), []).append(error)
    held = True
    for (kind, speed_mps), some in found.items():
        middle = OdometryError(*np.median([astuple(one) for one in some], axis=0).tolist())
        worst = reduce(OdometryError.worse, some)
        print(shown(f"median, {speed_mps:g} m/s", kind, middle))
        print(shown(f"worst, {speed_mps:g} m/s", kind, worst))
        if kind == BY_SCANS:
            held &= worst.position_m <= RMS_M and worst.heading_deg <= RMS_DEG and worst.of_turn <= OF_TURN
    sys.exit(not held)


if __name__ == "__main__":
    main()
