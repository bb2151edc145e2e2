"""Drives with a lidar whose bytes come late: contacts, and stops where they come in time.

Run: python -m benchmarks.late_lidar [--quick | --full] [--timeless]

The car's own drivers, tasks, laws and limiter run in virtual time; between the emulated sensor's bytes and the driver
is a link that is late by a constant from the start or from 5 s on, growing, stepping, or jittering within 60 ms.
One line for each kind and speed; exit code 1 after a contact, or after a stop that the same drive without jitter lacks.
The worlds take turns; --full drives each link in all of them. --quick: every fourth delay. --timeless: the sensor does
not answer TM.
"""

import argparse
import itertools
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Final

from tests.system.late_link import Constant, Drive, Growing, Jitter, LateDrive, Stepping, drive_late

WORLDS: Final = ("dead_end", "u_turn", "cluttered")
OPEN_WORLDS: Final = ("straight", "loop", "l_turn", "curved")
"""Where a car has no reason of its own to stop."""
SPEEDS_MPS: Final = (1.0, 2.0, 3.0, 4.0)
DELAYS_S: Final = tuple(round(0.05 * step, 2) for step in range(1, 21))
FROM_S: Final = 5.0
GROWS: Final = (0.0005, 0.001, 0.005, 0.02, 0.1)
JITTER_S: Final = 0.06


def kinds(*, quick: bool) -> Iterator[tuple[str, Callable[[float], float]]]:
    """Return the late links by name."""
    for late_s in DELAYS_S[3::4] if quick else DELAYS_S:
        yield "late from the start", Constant(late_s)
        yield "late from 5 s on", Constant(late_s, FROM_S)
    for rate in GROWS:
        yield "growing", Growing(rate)
    for step_s in (0.02, 0.04, 0.08, 0.15):
        yield "stepping", Stepping(step_s)


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive all, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--timeless", action="store_true")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    open_worlds = OPEN_WORLDS[:1] if options.quick else OPEN_WORLDS
    late = [
        (name, LateDrive(world, mps, late_s, timeless=options.timeless))
        for number, (name, late_s) in enumerate(kinds(quick=options.quick))
        for turn, mps in enumerate(SPEEDS_MPS)
        for place, world in enumerate(WORLDS)
        if options.full or place == (number // 2 + turn) % len(WORLDS)
    ]
    prompt, jittering = (
        [
            LateDrive(world, mps, late_s, timeless=options.timeless)
            for world, mps in itertools.product(open_worlds, SPEEDS_MPS)
        ]
        for late_s in (Constant(0.0), Jitter(JITTER_S))
    )
    with ProcessPoolExecutor(options.workers) as pool:
        found = list(pool.map(drive_late, [drive for _, drive in late]))
        in_time = list(zip(pool.map(drive_late, prompt), pool.map(drive_late, jittering), strict=True))
    return _print(list(zip(late, found, strict=True)), list(zip(jittering, in_time, strict=True)))


def _print(
    late: list[tuple[tuple[str, LateDrive], Drive]], jittering: list[tuple[LateDrive, tuple[Drive, Drive]]]
) -> int:
    print(f"{'link':22}{'m/s':>5}{'drives':>8}{'moved':>7}{'contacts':>10}")
    bad = 0
    for (name, mps), group in itertools.groupby(
        sorted(late, key=lambda one: (one[0][0], one[0][1].speed_mps)), lambda one: (one[0][0], one[0][1].speed_mps)
    ):
        ends = [(what, end) for (_, what), end in group]
        hit = [(what, end) for what, end in ends if end.contact_mps is not None]
        print(f"{name:22}{mps:5.1f}{len(ends):8}{sum(end.way_m > 0.1 for _, end in ends):7}{len(hit):10}")
        for what, end in hit:
            print(f"    {what}: {end.contact_mps:.2f} m/s after {end.ended_s:.1f} s")
        bad += len(hit)
    for what, (without, end) in jittering:
        more = end.stops - without.stops
        contact = end.contact_mps is not None and without.contact_mps is None
        print(f"jitter in {what.world:12}{what.speed_mps:5.1f} m/s: {end.stops} stops, {without.stops} without jitter")
        bad += more > 0 or contact
        for reason in end.reasons if more > 0 else ():
            print(f"    {reason}")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
