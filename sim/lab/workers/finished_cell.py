"""End of a cell: its figures, or why it failed in one sentence."""

import sys
import time
import traceback
from collections.abc import Callable, Generator, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from wallride.sim.lab.cell import Figures

C = TypeVar("C")
MAX_TRIES = 2
"""How often a cell is given to a worker that does not survive it."""


class WorkerStartError(RuntimeError):
    """No worker can be started; the text has the reason."""


@dataclass(frozen=True, slots=True)
class FinishedCell(Generic[C]):
    """End of a cell. index: its place in the list. figures: None where it failed; error: "" or why, in one sentence."""

    index: int
    cell: C
    figures: Figures | None
    error: str = ""
    took_s: float = 0.0


Ends = Generator[FinishedCell[C], None, None]
"""Ends of cells; `close` abandons the rest."""
Run = Callable[[Sequence[C]], Ends[C]]
"""Runs cells and yields the end of each."""


def finish(index: int, cell: C, work: Callable[[C], Figures]) -> FinishedCell[C]:
    """Run a cell and return its end, whatever it raises; what a law prints is no answer of the program's."""
    began_s = time.perf_counter()
    try:
        with redirect_stdout(sys.stderr):
            figures, error = work(cell), ""
    except Exception as raised:  # noqa: BLE001 - a failing cell is a result
        figures, error = None, sentence(raised)
    return FinishedCell(index, cell, figures, error, time.perf_counter() - began_s)


def sentence(error: BaseException) -> str:
    """Return an exception in one line: name, message, and file and line of its origin."""
    words = " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")
    frames: list[Any] = traceback.extract_tb(error.__traceback__)
    return f"{words} ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else words
