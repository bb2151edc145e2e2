"""The hot functions in C (`wallride.drivers.accelerated`): how they are built and sealed, and which are in use."""

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import FUNCTIONS, UnfitError, extension, sealed

if TYPE_CHECKING:  # a wheel is built with the standard library and numpy alone
    from wallride.runtime.realtime.prefetch import Prefetch

LINE_BYTES: Final = 64
MAPPINGS: Final = Path("/proc/self/maps")


@dataclass(frozen=True, slots=True)
class Kernel:
    """State of the accelerated functions. words: in a sentence. in_python: those that run in Python, and why.

    prefetch: has the processor fetch the cache lines at some addresses, an array of intp, (n,); None without C.
    path: the file of the compiled functions; "" without C.
    """

    words: str
    in_python: Mapping[str, str] = field(default_factory=dict)
    prefetch: "Prefetch | None" = None
    path: str = ""

    def code(self) -> npt.NDArray[np.intp]:
        """Return the addresses of the compiled functions' cache lines, (n,); none where mappings are not listed."""
        path = str(Path(self.path).resolve())  # as the kernel of the system lists it
        rows = [row.split(maxsplit=5) for row in MAPPINGS.read_text().splitlines()] if MAPPINGS.exists() else []
        spans = [row[0].split("-") for row in rows if row[-1] == path and row[1] in ("r-xp", "r--p")]
        empty = np.empty(0, np.intp)
        return np.concatenate(
            [empty, *(np.arange(int(a, 16), int(b, 16), LINE_BYTES) for a, b in spans)], dtype=np.intp
        )


def state() -> Kernel:
    """Return the state of the car's accelerated functions; imports their modules."""
    try:
        library = extension()
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
    return Kernel(words, in_python, library.prefetch, library.__file__ or "")
