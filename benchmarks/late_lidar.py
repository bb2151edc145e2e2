"""Drives with a lidar whose bytes come late: contacts, and stops where they come in time.

Run: python -m benchmarks.late_lidar [--quick | --full] [--timeless] [--data FOLDER] [--seed N]

The car's own drivers, tasks, laws and limiter run in virtual time; between the emulated sensor's bytes and the driver
is a link that is late by a constant from the start or from the fifth metre on, growing, stepping, or jittering within
60 ms. One line for each kind and speed; exit code 1 after a contact, or after a stop that the same drive without jitter
lacks. The worlds, and the buildings of FOLDER/maps, take turns; --full drives each link in all of them. --quick: every
fourth delay. --timeless: the sensor does not answer TM. The recordings of FOLDER/racecar are sent through the same
links: for them the true age of the scans that the driver delivers counts, and by how much it tells them too young.
"""

import argparse
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Final

import numpy as np

from tests.system.late_link import (
    Constant,
    Delivery,
    Growing,
    Jitter,
    LateDrive,
    Stepping,
    deliver_late,
    drive_late,
)
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.sim.recordings import load_recording

WORLDS: Final = ("dead_end", "u_turn", "cluttered", "loop", "doorway", "inside_corner")
MAPS: Final = ("levine", "stata_basement", "itrl", "hangar")
RECORDINGS: Final = ("t14_straight_2mps", "t14_inside_corner_2mps", "t3_brake_1_75mps", "t3_wall_data")
DATA: Final = Path("..", "shared", "data")
OPEN_WORLDS: Final = ("straight", "loop", "l_turn", "curved")
"""Where a car has no reason of its own to stop."""
SPEEDS_MPS: Final = (1.0, 2.0, 3.0, 4.0)
DELAYS_S: Final = tuple(round(0.05 * step, 2) for step in range(1, 21))
LATE_FROM_M: Final = 5.0
WAY_M: Final = 12.0
"""Way to the wall across the end of "dead_end"."""
GROWS: Final = (0.0005, 0.001, 0.005, 0.02, 0.1)
STEPS_S: Final = (0.02, 0.04, 0.08, 0.15)
JITTER_S: Final = 0.06
ROUNDING_S: Final = 0.01
"""The sensor's clock counts milliseconds, its answers are read within some."""


def kinds(delays_s: Sequence[float], speed_mps: float) -> Iterator[tuple[str, list[Callable[[float], float]]]]:
    """Return the late links of each kind."""
    yield "late from the start", [Constant(late_s) for late_s in delays_s]
    yield "late from 5 m on", [Constant(late_s, LATE_FROM_M / speed_mps) for late_s in delays_s]
    yield "growing", [Growing(rate, 2.0 / speed_mps) for rate in GROWS]
    yield "stepping", [Stepping(step_s, 2.0 / speed_mps) for step_s in STEPS_S]


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive all, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--timeless", action="store_true")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--data", type=Path, default=DATA, help="folder of maps and recordings")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    maps = (options.data / "maps" / f"{name}.yaml" for name in MAPS)
    worlds = [*WORLDS, *(str(path) for path in maps if path.exists())]
    delays_s = DELAYS_S[3::4] if options.quick else DELAYS_S
    print(f"{'link':22}{'m/s':>5}{'drives':>8}{'moved':>7}{'contacts':>10}")
    with ProcessPoolExecutor(options.workers) as pool:
        bad = 0
        for mps in SPEEDS_MPS:
            for name, links in kinds(delays_s, mps):
                drives = [
                    LateDrive(
                        world, mps, late_s, (LATE_FROM_M + WAY_M) / mps + 2.0, options.timeless, options.seed + number
                    )
                    for number, late_s in enumerate(links)
                    for place, world in enumerate(worlds)
                    if options.full or place == (number + options.seed) % len(worlds)
                ]
                bad += _contacts(pool, name, drives)
            for world in OPEN_WORLDS[:1] if options.quick else OPEN_WORLDS:
                bad += _more_stops(pool, world, mps, timeless=options.timeless)
        for name in RECORDINGS:
            if (path := options.data / "racecar" / f"{name}.npz").exists():
                bad += _too_old(pool, path, delays_s)
    return int(bad > 0)


def _contacts(pool: ProcessPoolExecutor, name: str, drives: list[LateDrive]) -> int:
    """Print the line of one kind of link at one speed; return the number of contacts."""
    found = list(zip(drives, pool.map(drive_late, drives), strict=True))
    hit = [(what, end) for what, end in found if end.contact_mps is not None]
    moved = sum(end.way_m > 0.1 for _, end in found)
    print(f"{name:22}{drives[0].speed_mps:5.1f}{len(found):8}{moved:7}{len(hit):10}", flush=True)
    for what, end in hit:
        print(f"    {what}: {end.contact_mps:.2f} m/s after {end.ended_s:.1f} s", flush=True)
    return len(hit)


def _more_stops(pool: ProcessPoolExecutor, world: str, mps: float, *, timeless: bool) -> int:
    """Print the stops of a drive with and without jitter; return how many more, or more contacts, jitter brought."""
    links = (Constant(0.0), Jitter(JITTER_S))
    drives = [LateDrive(world, mps, late_s, WAY_M / mps + 2.0, timeless=timeless) for late_s in links]
    prompt, late = pool.map(drive_late, drives)
    print(f"jitter, {world:14}{mps:5.1f}{late.stops:4} stops, {prompt.stops} without", flush=True)
    for reason in late.reasons if late.stops > prompt.stops else ():
        print(f"    {reason}", flush=True)
    return max(0, late.stops - prompt.stops) + (late.contact_mps is not None and prompt.contact_mps is None)


def _too_old(pool: ProcessPoolExecutor, path: Path, delays_s: Sequence[float]) -> int:
    """Print what is delivered of a recording; return the number of links by which too old a scan came, or a gap."""
    ranges_m = np.asarray(load_recording(path).ranges_m)
    links = [link for _, some in kinds(delays_s, LATE_FROM_M / 2.0) for link in some]
    found = list(pool.map(deliver_late, [ranges_m] * len(links), links))
    jittered = deliver_late(ranges_m, Jitter(JITTER_S))
    settings = HokuyoSettings()
    old = sum(one.oldest_s > settings.stale_after_s + ROUNDING_S for one in found)
    gaps = int(jittered.gap_s > settings.degraded_after_s)
    print(f"recording {path.stem:24}{len(links):4} links, {old} too old; {_worst([*found, jittered])}", flush=True)
    return old + gaps


def _worst(found: Sequence[Delivery]) -> str:
    oldest_s, younger_s = (
        max(ages_s) for ages_s in zip(*((one.oldest_s, one.younger_s) for one in found), strict=True)
    )
    gap_s = found[-1].gap_s
    return f"oldest {oldest_s * 1e3:.0f} ms, told {younger_s * 1e3:.0f} ms too young; jitter: gap {gap_s * 1e3:.0f} ms"


if __name__ == "__main__":
    sys.exit(main())
