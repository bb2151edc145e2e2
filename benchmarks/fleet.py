"""Several cars in one world in virtual time: what their traffic costs each of them, without any load of a computer.

Run: python -m benchmarks.fleet loop --cars 8 --minutes 10

The cars start as `wallride sim --cars` has them start, see each other's outlines in their scans, and drive with the
laws of the car. Each then drives once more alone, from the same start and with the same noise: the difference is the
traffic's. The processes, their telemetry and a late computer are not part of it. Exit code 1 after a contact.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.live.traffic import TrafficWorld, starts
from wallride.sim.scenario.simulated_car import find_config
from wallride.sim.virtual.closed_loop import Case, SimulatedRun, drive, drive_together
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.lap import LapCounter
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats
from wallride.sim.world.worlds import load_world

SETTLED_S = 5.0
"""Time from the standstill on that does not count."""


@dataclass(frozen=True, slots=True)
class Driven:
    """One car's drive: mean distance error, laps, smallest distance to anything, and the share of time it was held."""

    error_m: float
    laps: float
    clearance_m: float
    held: float
    contacts: int


def driven(run: SimulatedRun) -> Driven:
    """Return the figures of a run."""
    counts = run.time_s >= SETTLED_S
    lap, laps = run.case.world.lap, 0.0
    if lap is not None:
        counter = LapCounter(lap)
        laps = [counter.update(float(x_m), float(y_m)) for x_m, y_m, _ in run.pose][-1]
    error_m = np.abs(run.error_m[counts])
    return Driven(
        float(error_m[np.isfinite(error_m)].mean()), laps, float(run.clearance_m.min()),
        float(run.capped[counts].mean()), int(run.contact is not None),
    )  # fmt: skip


def cases(world: World, count: int, settings: Settings, duration_s: float, seed: int) -> list[Case]:
    """Return each car's case, as if it were alone."""
    follow = settings.wall_follow
    first = Case(
        world, desired_m=follow.desired_distance_m, side=follow.side, duration_s=duration_s, lidar=LidarSettings(),
        car=settings.car,
    )  # fmt: skip
    return [replace(first, start=pose, seed=seed + k) for k, pose in enumerate(starts(world, count, settings))]


def together(some: Sequence[Case], settings: Settings) -> list[SimulatedRun]:
    """Drive the cars in one world."""
    laws = [LiveLaws(settings.wall_follow, settings.safety, settings.car) for _ in some]

    def seen(vehicles: Sequence[Vehicle], k: int) -> TrafficWorld:
        return TrafficWorld(some[k].world, (), [other for i, other in enumerate(vehicles) if i != k])

    return drive_together(
        [(case, law, law) for case, law in zip(some, laws, strict=True)], seen, settings.car.max_speed_mps
    )


def alone(case: Case, settings: Settings) -> SimulatedRun:
    """Drive one car without the others."""
    laws = LiveLaws(settings.wall_follow, settings.safety, settings.car)
    return drive(case, laws, laws)


def gaps_m(runs: Sequence[SimulatedRun]) -> Floats:
    """Return the distance between the rear axles of each car and the nearest other one over time, shape (cars, n)."""
    count = min(len(run.time_s) for run in runs)
    places = np.stack([run.pose[:count, :2] for run in runs])
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    apart[np.arange(len(runs)), np.arange(len(runs))] = np.inf
    nearest: Floats = apart.min(axis=1)
    return nearest


def main() -> int:
    """Drive, and print a line for each car."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("world", nargs="?", default="loop")
    parser.add_argument("--cars", type=int, default=4)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--set", dest="assignments", action="append", default=[], metavar="KEY=VALUE")
    options = parser.parse_args()
    settings = load_settings(find_config(), options.assignments)
    world = load_world(options.world, side=settings.wall_follow.side)
    some = cases(world, options.cars, settings, options.minutes * 60, options.seed)
    runs = together(some, settings)
    nearest_m, touched = gaps_m(runs), 0
    for k, (case, run) in enumerate(zip(some, runs, strict=True)):
        here, by_itself = driven(run), driven(alone(case, settings))
        touched += here.contacts
        ended = f" after {run.contact.time_s:.1f} s: {run.reasons[-1]}" if run.contact is not None else ""
        print(
            f"car{k + 1}: error {here.error_m * 100:.3f} cm, alone {by_itself.error_m * 100:.3f}"
            f" ({here.error_m / by_itself.error_m - 1:+.1%}); laps {here.laps:.1f}, alone {by_itself.laps:.1f};"
            f" held {here.held:.1%}, alone {by_itself.held:.1%}; nearest car {nearest_m[k].min():.1f} m;"
            f" clearance {here.clearance_m:.2f} m; contacts {here.contacts}{ended}",
            flush=True,
        )
    return 1 if touched else 0


if __name__ == "__main__":
    raise SystemExit(main())
