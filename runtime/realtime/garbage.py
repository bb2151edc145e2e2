"""Collects young garbage when there is time for it: else Python does so when it likes, between a scan and its answer.

What was there at the start is frozen (`launch`), and the oldest generation is left alone: while driving, nothing that
has become old is dropped in circles (`benchmarks/hour.py` watches it).
"""

import gc
from typing import Final

YOUNG: Final = 300
"""Python itself begins at 700."""
OFTEN: Final = 10
"""After so many collections of the youngest, what survived them is looked at as well; as Python does."""


def collect_young() -> None:
    """Collect when enough has gathered that Python would soon; takes 0.1 ms then, and nothing otherwise."""
    young, survivals, _ = gc.get_count()
    if young > YOUNG:
        gc.collect(1 if survivals > OFTEN else 0)
