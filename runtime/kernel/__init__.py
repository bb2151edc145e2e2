"""The hot functions in C (`wallride.drivers.accelerated`): how they are built and sealed, and which are in use."""

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field

from wallride.drivers.accelerated import FUNCTIONS, UnfitError, extension, sealed


@dataclass(frozen=True, slots=True)
class Kernel:
    """State of the accelerated functions. words: in a sentence. in_python: those that run in Python, and why."""

    words: str
    in_python: Mapping[str, str] = field(default_factory=dict)


def state() -> Kernel:
    """Return the state of the car's accelerated functions; imports their modules."""
    try:
        extension()
        for name in sealed()["functions"]:
            if not name.startswith("wallride.sim."):
                importlib.import_module(name.rpartition(".")[0])
    except UnfitError as reason:
        return Kernel(f"the hot path runs in Python ({reason})", {name: one.why for name, one in FUNCTIONS.items()})
    in_python = {name: one.why for name, one in sorted(FUNCTIONS.items()) if one.why}
    reasons = sorted(set(in_python.values()))
    if len(in_python) == len(FUNCTIONS):
        return Kernel(f"the hot path runs in Python ({'; '.join(reasons)})", in_python)
    words = f"{len(FUNCTIONS) - len(in_python)} of {len(FUNCTIONS)} functions of the hot path are compiled"
    for why in reasons:
        words += f"; in Python: {', '.join(name for name, its in in_python.items() if its == why)} ({why})"
    return Kernel(words, in_python)
