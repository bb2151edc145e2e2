"""Random faults while the car drives, and an oracle that judges every motor command by the documented rules.

Run: python -m benchmarks.soak --virtual-hours 2 --seed 1
     python -m benchmarks.soak --real-minutes 30 --seed 1

In virtual time the car's own drivers, tasks, queue, mux, laws and limiter run in this process over in-memory bytes
(`tests/system/soak/virtual.py`). In real time the unmodified process runs between the byte emulators, with the car and
the emulators under SCHED_FIFO where that is allowed; memory and descriptors count from its fourth minute on: the
medians of what the process itself has taken, and the fewest descriptors, at either end.
Exit code 1 after a violation, a growth of MAX_GROWN_MIB or more, or a rising number of descriptors.
"""

import argparse
import logging
import statistics
import time
from collections.abc import Sequence
from typing import Final

from tests.system.soak.findings import Findings, Resources
from tests.system.soak.real import soak_in_real_time
from tests.system.soak.virtual import soak

MAX_GROWN_MIB: Final = 2.0
MIB: Final = 2**20
ENDS: Final = 10
"""Samples at either end that are compared."""


def main() -> int:
    """Run one soak, and print what it found."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every-s", type=float, default=10.0, help="mean time between two faults")
    duration = parser.add_mutually_exclusive_group()
    duration.add_argument("--virtual-hours", type=float, default=2.0)
    duration.add_argument("--real-minutes", type=float)
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    if options.real_minutes is None:
        return _virtual(options.virtual_hours * 3600, options.seed, options.every_s)
    findings, resources, late_s = soak_in_real_time(
        options.real_minutes * 60, options.seed, options.every_s, lambda line: print(line, flush=True)
    )
    _tell(findings)
    print(f"this process was late by {late_s * 1000:.0f} ms at most")
    return 0 if _are_flat(resources) and not findings.violations else 1


def _virtual(seconds: float, seed: int, every_s: float) -> int:
    began_s = time.process_time()
    findings = soak(seconds, seed, every_s, _tell_time)
    _tell(findings)
    print(f"{time.process_time() - began_s:.0f} s of a core")
    return 1 if findings.violations else 0


def _tell_time(now_s: float) -> None:
    if round(now_s) % 600 < 60:
        print(f"{now_s:6.0f} s", flush=True)


def _tell(findings: Findings) -> None:
    total = sum(findings.faults.values())
    print(
        f"{findings.seconds:.0f} s, {total} faults of {len(findings.faults)} kinds; {findings.commands} motor commands"
        f" judged, {findings.moving} of them moving; {findings.way_m:.0f} m driven,"
        f" {findings.contacts} contacts; {sum(findings.violations.values())} violations"
    )
    for name, count in findings.violations.items():
        print(f"  {count} x {name}")
    for line in [*findings.kept, *findings.touches]:
        print(f"  {line}")
    if never := [name for name, count in findings.faults.items() if not count]:
        print(f"never injected: {', '.join(never)}")


def _are_flat(resources: Resources) -> bool:
    """Print how memory and descriptors went; False when they grew."""
    if len(resources.memory_bytes) < 2 * ENDS:
        print("too short to judge memory and descriptors")
        return True
    descriptors = resources.descriptors
    grown_mib = _grown(resources.own_bytes) / MIB
    leaked = min(descriptors[-ENDS:]) - min(descriptors[:ENDS])  # the file of a black box comes and goes
    print(
        f"own memory {statistics.median(resources.own_bytes) / MIB:.1f} MiB, grown by {grown_mib:+.2f} MiB (resident"
        f" {statistics.median(resources.memory_bytes) / MIB:.1f}, {_grown(resources.memory_bytes) / MIB:+.2f}, with the"
        f" pages of programs and libraries); descriptors {min(descriptors)} to {max(descriptors)}, grown by {leaked:+d}"
    )
    return grown_mib < MAX_GROWN_MIB and leaked <= 0


def _grown(samples: Sequence[float]) -> float:
    return statistics.median(samples[-ENDS:]) - statistics.median(samples[:ENDS])


if __name__ == "__main__":
    raise SystemExit(main())
