"""Error of the odometry over WAY_M against the truth, with a gyro and without one.

Run: python -m benchmarks.racing.odometry --data DATA

The drives are those of `benchmarks.racing.maps`: a lap along the wall, wheels that report 3 % too much, a steering trim
of 0.02 rad, a gyro with bias, noise and a scale 1 % wrong, after 2 s of standing. "gyro, learnt": scale of the wheels
and slip of the rear axle are known, as a map tells them. Exit code 1 where that row does not hold.
"""

import argparse
import math
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks.racing.maps import MAPS, TRACKS, MapDrive, recorded
from wallride.drivers.api import MotorState
from wallride.runtime.control.localization.gyro_odometry import GyroOdometry
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.races.mapped_lap import WHEELS
from wallride.sim.world.pose import Floats

WAY_M, RMS_M, RMS_DEG = 10.0, 0.20, 1.2
DRIVES = ((2.0, 0.8), (4.0, 0.5))
GRAVITY = (0.0, 0.0, 9.81)
SLIP_S2PM = {0.8: 0.023, 0.5: 0.037}
"""Slip of the simulated tyres by friction (racing.md, section 1)."""
LEARNT = "gyro, learnt"
KINDS = {"steering": False, "gyro": True, LEARNT: True}


def path(record: LapRecord, kind: str, mu: float) -> Floats:
    """Return the poses at the reports, time and x, y, yaw each, (n, 4)."""
    car = CarSettings()
    odometry = GyroOdometry(car.wheelbase_m, car.steering_rate_radps)
    if kind == LEARNT:
        odometry.scale, odometry.slip_s2pm = 1.0 / WHEELS, SLIP_S2PM[mu]
    samples = iter(record.gyro.tolist() if KINDS[kind] else ())
    sample, found = next(samples, None), []
    for time_s, way_m, speed_mps, steering_rad in record.reports.tolist():
        while sample is not None and sample[0] <= time_s:
            odometry.take(sample[0], (0.0, 0.0, sample[1]), GRAVITY)
            sample = next(samples, None)
        pose = odometry.update(MotorState(time_s, speed_mps, way_m, steering_rad))
        found.append((time_s, pose.x_m, pose.y_m, pose.yaw_rad))
    return np.array(found)


def errors(record: LapRecord, truth: Floats, told: Floats) -> tuple[float, float, float]:
    """Return rms of position [m] and heading [degrees] after WAY_M, and of the heading's share per right angle."""
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
    turned = (at[ends, 2] - at[begins, 2]) - (true[ends, 2] - true[begins, 2])
    angles = abs(true[-1, 2] - true[0, 2]) / (math.pi / 2)
    whole = abs((at[-1, 2] - at[0, 2]) - (true[-1, 2] - true[0, 2])) / (math.pi / 2) / max(angles, 1.0)
    return (
        float(np.sqrt(np.mean(np.abs(moved[0] - moved[1]) ** 2))),
        math.degrees(float(np.sqrt(np.mean(turned**2)))),
        whole,
    )


def driven(drive: MapDrive, data: Path) -> dict[str, tuple[float, float, float]]:
    """Return the errors of one drive by kind."""
    record, truth = recorded(drive, data)
    return {kind: errors(record, truth, path(record, kind, drive.mu)) for kind in KINDS}


def main() -> None:
    """Print a line for each drive and kind, and the worst."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=11000)
    options = parser.parse_args()
    drives = [
        MapDrive(place, speed, mu, options.seed + number, gyro=True)
        for number, place in enumerate((*MAPS, *TRACKS))
        for speed, mu in DRIVES
    ]
    worst = dict.fromkeys(KINDS, (0.0, 0.0, 0.0))
    print(f"{'drive':34}{'kind':16}{'position m':>11}{'heading deg':>12}{'per right angle':>16}")
    with ProcessPoolExecutor() as pool:
        for drive, found in zip(drives, pool.map(driven, drives, [options.data] * len(drives)), strict=True):
            for kind, (rms_m, rms_deg, share) in found.items():
                name = f"{drive.place}, {drive.speed_mps:g} m/s, mu {drive.mu:g}"
                print(f"{name:34}{kind:16}{rms_m:11.3f}{rms_deg:12.2f}{share:16.2%}", flush=True)
                was = worst[kind]
                worst[kind] = max(was[0], rms_m), max(was[1], rms_deg), max(was[2], share)
    for kind, (rms_m, rms_deg, share) in worst.items():
        print(f"{'worst':34}{kind:16}{rms_m:11.3f}{rms_deg:12.2f}{share:16.2%}")
    held = worst[LEARNT]
    sys.exit(held[0] > RMS_M or held[1] > RMS_DEG)


if __name__ == "__main__":
    main()
