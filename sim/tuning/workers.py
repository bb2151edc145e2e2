"""Processes that stay for a whole study: a trial takes seconds, and starting a process a second."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

from sim.lab.cell import Cell, Figures
from sim.lab.tuning import drive

Measure = Callable[[Sequence[Cell]], list[Figures]]


@contextmanager
def measuring(jobs: int | None) -> Iterator[Measure]:
    """Yield a function that returns the figures of cells in their order, on that many processes (default: all cores).

    Figures do not depend on the number. Ctrl-C ends the processes.
    """
    jobs = jobs or os.cpu_count() or 1
    if jobs == 1:
        yield lambda cells: [_measured(cell) for cell in cells]
        return
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, mp_context=spawn, initializer=_ignore_ctrl_c)
    try:
        yield lambda cells: list(pool.map(_measured, cells))
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _measured(cell: Cell) -> Figures:
    return cell.named(drive.measure(cell))


def _ignore_ctrl_c() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
