"""One way to run many cells: `submit(cells, work)` yields each one's end, in any order.

A cell is a small value that can be pickled; `work` is a function of a module that turns one into figures. What runs
them (this process, processes of this machine, a Ray cluster) is chosen here and nowhere else, so that the work has one
code path. A cell that fails is a result with its sentence; a worker that is killed costs its cell, which is run again.
"""

import os
from collections.abc import Callable, Sequence
from typing import TypeVar

from sim.lab.cell import Figures
from sim.lab.workers.finished_cell import Ends, finish
from sim.lab.workers.local_pool import run_on_processes
from sim.lab.workers.ray_cluster import run_on_ray

C = TypeVar("C")


def submit(cells: Sequence[C], work: Callable[[C], Figures], *, jobs: int | None = None, on: str = "") -> Ends[C]:
    """Yield the end of every cell as it comes; each exactly once.

    jobs: processes, None for one per core. One process is this one. on: "" for this machine's processes, "ray" for a
    Ray cluster on this machine, or the address of one. An abandoned generator (KeyboardInterrupt, `close`)
    ends all workers. Raises WorkerStartError where no worker comes up.
    """
    if on and cells:
        yield from run_on_ray(cells, work, on, jobs)
        return
    jobs = min(jobs or os.cpu_count() or 1, len(cells))
    if jobs > 1:
        yield from run_on_processes(cells, work, jobs)
        return
    for index, cell in enumerate(cells):
        yield finish(index, cell, work)
