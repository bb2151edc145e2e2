"""The map of a course, made of one simulated lap along its wall as `wallride map` makes it, beside the truth.

The lap is driven by `ball`: ranges with 20 mm of noise and 2 % of outliers, the sweep skewed by the motion, wheels that
report 3 % too much, a steering trim of 0.02 rad, a gyro with a bias of 0.01 rad/s, noise of 0.01 rad/s and a scale 1 %
wrong, after 2 s of standing.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.guidance import Follower, Guidance
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.host.output_files import write_files
from wallride.runtime.map_files import ABOUT, walls_text
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.cell import course_name
from wallride.sim.lab.laws import build
from wallride.sim.mapping.closing import ClosedLap, close_lap
from wallride.sim.mapping.lap_record import LapRecord, record_of_scans
from wallride.sim.mapping.map_output import map_files, path_of
from wallride.sim.mapping.odometry_path import of_the_axle
from wallride.sim.mapping.raster import rasterized
from wallride.sim.mapping.verdict import judge_map
from wallride.sim.mapping.walls import walls_of
from wallride.sim.racing.ring import NoRingError, ring_length_m, ring_of
from wallride.sim.recordings import RecordingError
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats
from wallride.sim.world.worlds import load_world

LATER_M = 15.0
"""Way past the start, on which the loop is closed."""
WHEELS, TRIM_RAD = 1.03, 0.02
GYRO_BIAS_RADPS, GYRO_NOISE_RADPS, GYRO_SCALE = 0.01, 0.01, 1.01
STANDING_S, RATE_S = 2.0, 0.02
NEAREST = 8
TRUTH_SUFFIX = ".truth.npz"


@dataclass(frozen=True, slots=True)
class MappingLap:
    """Conditions of the lap. gyro: whether the recording has one. wheels: reported way over the true one."""

    speed_mps: float = 2.0
    mu: float = 0.8
    seed: int = 1000
    gyro: bool = True
    wheels: float = WHEELS


class KeepingFollower:
    """A follower that keeps what it is given."""

    def __init__(self, follower: Follower) -> None:
        self._follower = follower
        self.scans: list[Scan] = []
        self.states: list[MotorState] = []

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer as the follower does."""
        self.scans.append(scan)
        if motor is not None:
            self.states.append(motor)
        return self._follower.follow(scan, motor)


def recorded_lap(world: World, lap: MappingLap) -> tuple[LapRecord, Floats]:
    """Return the recording of a lap and LATER_M more, and the true poses of the rear axle at its scans, (n, 3).

    Raises: NoRingError where the world has no way round.
    """
    desired_m = min(1.0, world.room_m)
    follower, guard = build("ball", world.side, desired_m, lap.speed_mps)
    keeper = KeepingFollower(follower)
    way_m = 1.05 * ring_length_m(ring_of(world)) + LATER_M
    case = Case(
        world, desired_m=desired_m, distance_m=way_m, duration_s=300.0, standing_s=5.0, seed=lap.seed,
        vehicle=VehicleSettings(grip_mu=lap.mu, trim_rad=TRIM_RAD),
    )  # fmt: skip
    run = drive(case, keeper, guard)
    record = record_of_scans(world.name, keeper.scans, keeper.states, CarSettings())
    reports = record.reports * np.array([1.0, lap.wheels, lap.wheels, 1.0])
    standing_s = np.arange(-STANDING_S, 0.0, RATE_S)
    stood = np.column_stack([standing_s, *np.zeros((3, standing_s.size))])
    record = replace(record, reports=np.vstack([stood, reports]))
    if lap.gyro:
        record = replace(record, gyro=_gyro(record.scan_s, run.pose[:, 2], standing_s, lap.seed))
    return record, run.pose


def _gyro(time_s: Floats, yaw_rad: Floats, standing_s: Floats, seed: int) -> Floats:
    rates = np.diff(np.unwrap(yaw_rad)) / np.diff(time_s)
    true = np.concatenate([np.zeros(standing_s.size), rates])
    noise = np.random.default_rng(seed).normal(0.0, GYRO_NOISE_RADPS, true.size)
    at_s = np.concatenate([standing_s, (time_s[1:] + time_s[:-1]) / 2])
    return np.column_stack([at_s, GYRO_SCALE * true + GYRO_BIAS_RADPS + noise])


@dataclass(frozen=True, slots=True, eq=False)
class KeyframePoses:
    """Poses (k, 3) of a map's keyframes, in the truth's frame and on the map; one where both frames are the same."""

    true: Floats
    found: Floats

    def of(self, truth: Floats, keyframes: int = NEAREST) -> Floats:
        """Return true poses (n, 3) on the map, by so many of the nearest keyframes; by all: one rigid alignment."""
        places, spots = truth[:, 0] + 1j * truth[:, 1], self.true[:, 0] + 1j * self.true[:, 1]
        there = self.found[:, 0] + 1j * self.found[:, 1]
        found = np.empty_like(truth)
        for number, place in enumerate(places):
            near = np.argsort(np.abs(spots - place))[:keyframes]
            true_m, found_m = spots[near].mean(), there[near].mean()
            turns = np.exp(1j * (self.found[near, 2] - self.true[near, 2])).mean()
            if keyframes >= len(spots) > 1:
                turns = np.vdot(spots - true_m, there - found_m)
            turn = turns / abs(turns)
            at = found_m + turn * (place - true_m)
            found[number] = at.real, at.imag, truth[number, 2] + np.angle(turn)
        return found


def keyframe_poses(record: LapRecord, lap: ClosedLap, truth: Floats) -> KeyframePoses:
    """Return the poses of a lap's keyframes. truth: at the scans of its recording, (n, 3)."""
    index = np.searchsorted(record.scan_s, [frame.time_s for frame in lap.frames])
    return KeyframePoses(truth[index], of_the_axle(lap.poses, record.lidar_m))


def map_course(course: str, folder: Path) -> str:
    """Write the map of a course's lap into a folder; return why there is none, "" where there is one.

    course: as of `load_world`. A map that is there already is kept; a refused one says so (`refusal_of`).
    """
    file = map_file(course, folder)
    if file.with_suffix(TRUTH_SUFFIX).is_file():
        return ""
    try:
        record, truth = recorded_lap(load_world(course), MappingLap())
        lap = close_lap(record)
    except (NoRingError, RecordingError) as error:
        return str(error)
    raster = rasterized(lap.frames, lap.poses, record.kind[1])
    about = f"{ABOUT}{record.name}, {judge_map(record, lap).words}"
    walls = walls_text(walls_of(lap, raster), lap.car.scale, about)
    write_files(map_files(file.with_suffix(""), raster, path_of(record, lap), walls, about, course))
    poses = keyframe_poses(record, lap, truth)
    np.savez(file.with_suffix(TRUTH_SUFFIX), true=poses.true, found=poses.found)
    return ""


def map_file(course: str, folder: Path) -> Path:
    """Return the place of a course's map in the folder."""
    return folder / f"{course_name(course).replace(':', '-').replace('=', '-')}.yaml"


def poses_of_map(file: Path) -> KeyframePoses:
    """Return the poses of the keyframes of a map that `map_course` wrote."""
    kept = np.load(file.with_suffix(TRUTH_SUFFIX))
    return KeyframePoses(kept["true"], kept["found"])
