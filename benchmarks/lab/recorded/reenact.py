"""Simulation of a recorded run at a wall, against the walls of its own scans, under `swept` alone.

The team's own controller stopped the recorded car before `swept` found it necessary, so the recording alone does not
show its braking. The last scan before the car set off becomes a world (neighbouring beams on one surface are joined), a
blind navigator requests the recorded speed straight on, and safety, vehicle and brake are those of the lab.
"""

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.lab.recorded.replay import JudgedScan, Replay
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.courses.sudden import BlindDriver
from wallride.sim.lab.safety import impact_mps, stopping_m
from wallride.sim.virtual.closed_loop import Case, drive
from wallride.sim.world.place import World
from wallride.sim.world.pose import CAR, Floats, Pose
from wallride.sim.world.segments import SegmentGeometry

JOINED_M = 0.3
STRAIGHT_WITHIN_RAD = math.radians(15)
AT_REST_WITHIN_M = 1.2
"""Maximum distance ahead at the end of a run that was driven at a wall."""
MUS = (0.8, 0.5)
LOOK_M = 4.0


@dataclass(frozen=True, slots=True)
class Braking:
    """Braking of one run: the gap is from the bumper to the nearest point straight ahead. NaN for what did not happen.

    slower_*: when safety first requested less than the wished speed. rest_m: the gap at the end; 0 in contact.
    needs_m: what physics needs to stop from slower_mps with the whole grip; impact_mps: where that is too much.
    """

    mu: float
    slower_scan: int
    slower_gap_m: float
    slower_mps: float
    braked_gap_m: float
    braked_mps: float
    rest_m: float
    touched_mps: float
    needs_m: float
    impact_mps: float


@dataclass(frozen=True, slots=True)
class Recorded:
    """The recorded braking: when the recorded mux first fell to 0 while the car drove, and its place of rest."""

    asked_mps: float
    sets_off: int
    braked_scan: int
    braked_gap_m: float
    braked_mps: float
    fastest_mps: float
    rest_m: float


def run_at_wall(done: Replay) -> Recorded | None:
    """Return the run at a wall that a recording shows, None without one."""
    motion, judged = done.motion, done.judged
    moving = np.flatnonzero(motion.speed_mps > 0.3)
    if not moving.size or abs(motion.yaw_rad[moving[-1]] - motion.yaw_rad[moving[0]]) > STRAIGHT_WITHIN_RAD:
        return None
    sets_off = int(moving[0])
    rests = next((scan for scan in range(sets_off, len(judged)) if abs(judged[scan].motor.speed_mps) < 0.1), None)
    if rests is None or done.recording.output is None:
        return None
    rest_m = gap_m(judged[rests])
    asked_mps = max(scan.asked.speed_mps for scan in judged)
    braked = next((scan for scan in range(sets_off, rests) if judged[scan].asked.speed_mps <= 0), rests)
    if rest_m > AT_REST_WITHIN_M:
        return None
    return Recorded(
        asked_mps, sets_off, braked, gap_m(judged[braked]), judged[braked].motor.speed_mps,
        float(motion.speed_mps.max()), rest_m,
    )  # fmt: skip


def reenact(done: Replay, run: Recorded) -> list[Braking]:
    """Drive the run again with `swept` alone, on each floor."""
    begin = max(0, run.sets_off - 20)
    world = world_of(done.judged[begin])
    return [_braking(world, run.asked_mps, mu, begin) for mu in MUS]


def gap_m(judged: JudgedScan) -> float:
    """Return the bumper's distance to the nearest point straight ahead, inf without one."""
    view, car = judged.assessment.view, CarSettings()
    before = view.solid & (np.abs(view.y_m) < car.half_width_m) & (view.x_m > car.front_m)
    ahead_m = np.sort(view.x_m[before])
    return float(ahead_m[2]) - car.front_m if ahead_m.size > 2 else math.inf


def world_of(judged: JudgedScan) -> World:
    """Return the surfaces of one scan as walls, in base_link."""
    view = judged.assessment.view
    points_m = np.stack([view.x_m, view.y_m], axis=1)[view.solid]
    near = np.hypot(*(points_m[1:] - points_m[:-1]).T) < JOINED_M
    segments: Floats = np.hstack([points_m[:-1], points_m[1:]])[near]
    return World("scan", SegmentGeometry(segments), Pose(0.0, 0.0, 0.0))


def _braking(world: World, asked_mps: float, mu: float, begin: int) -> Braking:
    car = CarSettings()
    guard = SweptGuard(SweptSettings(), car)
    ahead_m = float(world.cast(CAR.front_m, 0.0, np.array([0.0]))[0])
    case = Case(
        world, Pose(0.0, 0.0, 0.0), distance_m=LOOK_M, duration_s=8.0, standing_s=1.0,
        vehicle=VehicleSettings(grip_mu=mu), seed=1000,
    )  # fmt: skip
    done = drive(case, BlindDriver(asked_mps), guard)
    gaps_m = ahead_m - done.pose[:, 0]
    lowered = np.flatnonzero((done.capped > 0) & (done.command[:, 0] < done.speed_mps[:, 0]))
    stopped = np.flatnonzero((done.capped > 0) & (done.command[:, 0] <= 0))
    slower, hard = (int(found[0]) if found.size else -1 for found in (lowered, stopped))
    speed_mps = float(done.speed_mps[slower, 0])
    latency_s = case.latency_s + case.vehicle.drive_delay_s
    brake_mps2 = min(case.brake_limit_mps2, mu * GRAVITY_MPS2)
    return Braking(
        mu,
        begin + slower,
        float(gaps_m[slower]),
        speed_mps,
        float(gaps_m[hard]),
        float(done.speed_mps[hard, 0]),
        0.0 if done.contact else float(gaps_m[-1]),
        done.contact.speed_mps if done.contact else 0.0,
        stopping_m(speed_mps, latency_s, brake_mps2),
        impact_mps(speed_mps, float(gaps_m[slower]), latency_s, brake_mps2),
    )
