"""Random histories of the whole car in virtual time: operators, planners, parameters, an own law, faults, shutdown.

Run: python -m benchmarks.histories --count 20000 --seed 1

One seed is one history (`tests/system/soak/histories.py`), judged by rules that know the documents and not the code
(`history_rules.py`). Every violation is printed with its seed; `--seed N --count 1` repeats it. A run that was ended
goes on with the seed printed last. Exit code 1 after a violation.
"""

import argparse
import logging
import time
from typing import Final

from tests.system.soak.histories import Found, tell

EVERY: Final = 500


def main() -> int:
    """Run them, and print what they found."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1, help="the first one")
    parser.add_argument("--minutes", type=float, default=240.0, help="end after this time")
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    began_s, told = time.monotonic(), 0

    def watch(found: Found) -> bool:
        nonlocal told
        for line in found.kept[told:]:
            print(line, flush=True)
        told = len(found.kept)
        over = time.monotonic() - began_s > 60 * options.minutes
        if over or found.histories % EVERY == 0:
            print(f"{found.histories} histories; the next seed is {options.seed + found.histories}", flush=True)
        return not over

    found = tell(range(options.seed, options.seed + options.count), watch)
    print(
        f"{found.histories} histories of {found.seconds:.0f} s in all, {sum(found.events.values())} events,"
        f" {sum(found.incidents.values())} incidents, moved by {dict(found.moved)};"
        f" {sum(found.violations.values())} violations"
    )
    for name, count in found.violations.items():
        print(f"  {count} x {name}")
    return 1 if found.violations else 0


if __name__ == "__main__":
    raise SystemExit(main())
