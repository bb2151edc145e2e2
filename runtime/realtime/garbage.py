"""Garbage collection at chosen moments: otherwise Python collects at any time, also between a scan and its answer.

The objects present at the start are frozen (`launch`), and the oldest generation is left alone: while driving, no old
object becomes garbage in a reference cycle (`benchmarks/hour.py` verifies it).
"""

import gc
from typing import Final

YOUNG: Final = 300
"""Number of young objects at which to collect; Python itself begins at 700."""
OFTEN: Final = 10
"""Number of collections of the youngest generation after which the second one is collected too, as in Python."""


def collect_young() -> None:
    """Collect when Python would do so soon; takes 0.1 ms then, and nothing otherwise."""
    young, survivals, _ = gc.get_count()
    if young > YOUNG:
        gc.collect(1 if survivals > OFTEN else 0)
