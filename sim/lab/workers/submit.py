"""One way to run many cells: `submit(cells, work)` yields each one's end, in any order; `workers` for several calls.

A cell is a small value that can be pickled; `work` is a function of a module that turns one into figures. What runs
them (this process, processes of this machine, a Ray cluster) is chosen here and nowhere else, so that the work has one
code path. A cell that fails is a result with its sentence; a worker that is killed costs its cell, which is run again.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from wallride.runtime.control.own_laws.law_class import loaded_files
from wallride.sim.lab.cell import Figures
from wallride.sim.lab.workers.finished_cell import Ends, Run, finish
from wallride.sim.lab.workers.local_pool import processes
from wallride.sim.lab.workers.ray_cluster import ray_tasks

C = TypeVar("C")


def submit(cells: Sequence[C], work: Callable[[C], Figures], *, jobs: int | None = None, on: str = "") -> Ends[C]:
    """Yield the end of every cell as it comes; each exactly once.

    jobs: processes, None for one per core. One process is this one, but for laws of the user, which may end theirs.
    on: "" for this machine's processes, "ray" for a Ray cluster on this machine, or the address of one. An abandoned
    generator (KeyboardInterrupt, `close`) ends all workers. Raises WorkerStartError where no worker comes up.
    """
    if cells:
        with workers(work, jobs=jobs if on else min(jobs or os.cpu_count() or 1, len(cells)), on=on) as run:
            yield from run(cells)


@contextmanager
def workers(work: Callable[[C], Figures], *, jobs: int | None = None, on: str = "") -> Iterator[Run[C]]:
    """Yield what runs cells as `submit` does, on processes or a cluster that stay until the end."""
    if on:
        with ray_tasks(work, on, jobs) as run:
            yield run
    elif loaded_files() or (jobs or os.cpu_count() or 1) > 1:
        with processes(work, jobs or os.cpu_count() or 1) as run:
            yield run
    else:
        yield lambda cells: _here(cells, work)


def _here(cells: Sequence[C], work: Callable[[C], Figures]) -> Ends[C]:
    for index, cell in enumerate(cells):
        yield finish(index, cell, work)
