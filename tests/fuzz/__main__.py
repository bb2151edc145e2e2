"""Every parser that faces the outside, with damaged inputs: no exception out, no slow input, no growing memory.

Run: make fuzz, or python -m tests.fuzz [--seconds 30] [--count N] [--seed 1] [--findings FOLDER] [TARGET ...]

Ten million inputs, in some seven minutes of a core: --count 2000000 --seconds 36000 scip vesc teleop parameters page.

--seconds is shared by the targets, --count is for each. An input that raises, or takes longer than SLOW_S of this
process's time, is written to the folder, and the exit code is 1.
"""

import argparse
import contextlib
import logging
import random
import resource
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.fuzz.file_targets import Files
from tests.fuzz.mutation import mutated
from tests.fuzz.wire_targets import seeds_of_wires
from wallride.runtime import kernel

SLOW_S = 0.5
MAX_GROWN_KB = 200_000
MAX_FINDINGS = 10
Target = Callable[[random.Random, bytes], None]


def fuzz(name: str, target: Target, good: list[bytes], most: int, *, seed: int, count: int, seconds: float,
         findings: Path) -> tuple[int, int]:  # fmt: skip
    """Return the numbers of inputs and of findings of one target."""
    dice = random.Random(f"{name} {seed}")
    until_s = time.monotonic() + seconds
    tried = found = 0
    while tried < count and found < MAX_FINDINGS and (tried % 16 or time.monotonic() < until_s):
        data = mutated(dice, dice.choice(good), good, most)
        tried += 1
        begun_s = time.process_time()
        try:
            target(dice, data)
        except BaseException:
            if sys.exc_info()[0] is KeyboardInterrupt:
                raise
            what = traceback.format_exc()[-3000:]
        else:
            took_s = time.process_time() - begun_s
            what = f"took {took_s:.2f} s" if took_s > SLOW_S else ""
        if what:
            found += 1
            file = findings / f"{name}-{seed}-{tried}"
            findings.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
            print(f"{name}: {len(data)} bytes in {file}\n{what}", flush=True)
    return tried, found


def main() -> int:
    """Fuzz, and print one line for each target."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("target", nargs="*")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--count", type=int, default=sys.maxsize)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--findings", type=Path, default=Path("fuzz-findings"))
    options = parser.parse_args()
    logging.disable()  # it has a rate limit, and is not looked at here
    print(kernel.state().words)
    with contextlib.closing(Files()) as files:
        return run(options, {**seeds_of_wires(), **files.seeds()})


def run(options: argparse.Namespace, targets: dict[str, Any]) -> int:
    """Fuzz the chosen targets; return the exit code."""
    chosen = {name: targets[name] for name in options.target or targets}
    for target, good, _ in chosen.values():
        for data in good:
            target(random.Random(0), data)  # what is imported late is no growth
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    total = failed = 0
    for name, (target, good, most) in chosen.items():
        begun_s = time.process_time()
        tried, found = fuzz(name, target, good, most, seed=options.seed, count=options.count,
                            seconds=options.seconds / len(chosen), findings=options.findings)  # fmt: skip
        took_s = time.process_time() - begun_s
        print(f"{name:12}{tried:10} inputs  {took_s / max(tried, 1) * 1e6:8.0f} us each  {found} findings", flush=True)
        total, failed = total + tried, failed + found
    grown_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb
    print(f"{total} inputs, {failed} findings, peak memory grew by {grown_kb / 1000:.0f} MB")
    return 1 if failed or grown_kb > MAX_GROWN_KB else 0


if __name__ == "__main__":
    sys.exit(main())
