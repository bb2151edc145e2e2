"""Drives with a lidar whose bytes come late: contacts, and stops where they come in time.

Run: python -m benchmarks.late_lidar [--quick | --full] [--timeless]

The car's own drivers, tasks, laws and limiter run in virtual time; between the emulated sensor's bytes and the driver
is a link that is late by a constant from the start or from the fifth metre on, growing, stepping, or jittering within
60 ms. One line for each kind and speed; exit code 1 after a contact, or after a stop that the same drive without jitter
lacks. The worlds take turns; --full drives each link in all of them. --quick: every fourth delay. --timeless: the
sensor does not answer TM.
"""

import argparse
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Final

from tests.system.late_link import Constant, Growing, Jitter, LateDrive, Stepping, drive_late

WORLDS: Final = ("dead_end", "u_turn", "cluttered")
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
    options = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    print(f"{'link':22}{'m/s':>5}{'drives':>8}{'moved':>7}{'contacts':>10}")
    with ProcessPoolExecutor(options.workers) as pool:
        bad = 0
        for mps in SPEEDS_MPS:
            for name, links in kinds(DELAYS_S[3::4] if options.quick else DELAYS_S, mps):
                drives = [
                    LateDrive(world, mps, late_s, (LATE_FROM_M + WAY_M) / mps + 2.0, timeless=options.timeless)
                    for number, late_s in enumerate(links)
                    for place, world in enumerate(WORLDS)
                    if options.full or place == number % len(WORLDS)
                ]
                bad += _contacts(pool, name, drives)
            for world in OPEN_WORLDS[:1] if options.quick else OPEN_WORLDS:
                bad += _more_stops(pool, world, mps, timeless=options.timeless)
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


if __name__ == "__main__":
    sys.exit(main())
