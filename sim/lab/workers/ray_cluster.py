"""Processes of a Ray cluster: one on this machine ("ray"), or one that is there ("HOST:PORT", "ray://HOST:10001").

Ray runs a cell again whose worker or node has died; every cell ends once all the same, because its end is taken once.
"""

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any, TypeVar

from wallride.runtime.host.extras import how_to_install
from wallride.sim.lab.cell import Figures
from wallride.sim.lab.workers.finished_cell import Ends, FinishedCell, Run, WorkerStartError, finish, sentence

C = TypeVar("C")
LOCAL = "ray"
LOOPBACK = "127.0.0.1"
RETRIES = 3
"""How often a cell is run again whose worker or node died: while a node goes, a cell may meet it twice."""
AHEAD = 2
"""Cells per processor that are handed over at a time."""


@contextmanager
def ray_tasks(work: Callable[[C], Figures], on: str, jobs: int | None) -> Iterator[Run[C]]:
    """Yield a function that runs cells on a cluster; see `workers`. jobs: processors of a cluster on this machine."""
    ray = _connected(on, jobs)
    try:
        yield lambda cells: _run(ray, cells, work)
    finally:
        ray.shutdown()


def _run(ray: Any, cells: Sequence[C], work: Callable[[C], Figures]) -> Ends[C]:  # noqa: ANN401 - ray is an extra
    remote = ray.remote(max_retries=RETRIES, num_cpus=1)(finish)
    next_index = 0
    pending: dict[Any, int] = {}
    while next_index < len(cells) or pending:
        most = AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
        while next_index < len(cells) and len(pending) < most:
            pending[remote.remote(next_index, cells[next_index], work)] = next_index
            next_index += 1
        (ended, *_), _ = ray.wait(list(pending), num_returns=1)
        yield _end(ray, ended, pending.pop(ended), cells)


def _end(ray: Any, ended: Any, index: int, cells: Sequence[C]) -> FinishedCell[C]:  # noqa: ANN401 - ray is an extra
    try:
        done: FinishedCell[C] = ray.get(ended)
    except ray.exceptions.RayError as error:
        return FinishedCell(index, cells[index], None, sentence(error)[:500])
    return done


def _connected(on: str, jobs: int | None) -> Any:  # noqa: ANN401 - ray is an extra
    """Return the module `ray`, connected; WorkerStartError where that is not possible."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        ray: Any = import_module("ray")
    except ModuleNotFoundError:
        raise WorkerStartError(f"--on needs Ray: install it with {how_to_install('cluster')}") from None
    threads = {"env_vars": {"OPENBLAS_NUM_THREADS": "1"}}
    where: dict[str, Any] = {"address": on}
    if on == LOCAL:
        os.environ.setdefault("RAY_AUTH_MODE", "token")  # who has no token of this user runs nothing here
        where = {"address": "local", "num_cpus": jobs or os.cpu_count(), "include_dashboard": False}
        where["_node_ip_address"] = LOOPBACK  # Ray would listen on every interface
    try:
        ray.init(**where, runtime_env=threads, log_to_driver=False, logging_level="ERROR")
    except Exception as error:  # noqa: BLE001 - Ray has no error of its own for all that can be wrong
        with contextlib.suppress(Exception):
            ray.shutdown()
        raise WorkerStartError(f"--on {on}: no Ray cluster answers there ({sentence(error)[:300]})") from None
    return ray
