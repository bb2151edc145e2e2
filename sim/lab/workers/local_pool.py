"""Processes of this machine: each gets one cell at a time, so that one that is killed takes nothing but its cell along.

`concurrent.futures` gives up a whole pool with one process. Here each worker has a pipe of its own; its end is that of
the worker, and another one takes its place.
"""

import multiprocessing
import os
import signal
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, TypeVar

from wallride.runtime.host.stop_signals import STOP_SIGNALS_HELD
from wallride.sim.lab.cell import Figures
from wallride.sim.lab.workers.finished_cell import MAX_TRIES, Ends, FinishedCell, Run, WorkerStartError, finish

C = TypeVar("C")
_SPAWN = multiprocessing.get_context("spawn")
_READY = "ready"
_ENDED_WITHIN_S = 5.0
UNSTARTED = -1
"""In the place of a cell's index: tries of workers that have not had one."""


@dataclass(slots=True, eq=False)
class _Worker:
    """A process, its pipe, and the index of the cell that it has (None: it waits)."""

    process: SpawnProcess
    pipe: Connection
    index: int | None = None
    started: bool = False

    def end(self) -> None:
        """End the process now."""
        self.process.kill()
        self.process.join()
        self.pipe.close()

    def last_words(self) -> str:
        """Return how the process ended."""
        self.process.join(_ENDED_WITHIN_S)
        code = self.process.exitcode
        return f"was ended by signal {-code}" if code is not None and code < 0 else f"ended with exit code {code}"


@contextmanager
def processes(work: Callable[[C], Figures], jobs: int) -> Iterator[Run[C]]:
    """Yield a function that runs cells on `jobs` processes, which stay from one call to the next; see `workers`."""
    there: list[_Worker] = []

    def run(cells: Sequence[C]) -> Ends[C]:
        there.extend(_start(work, min(jobs, len(cells)) - len(there)))
        return _run(there, cells, work)

    try:
        yield run
    finally:
        for worker in there:
            worker.end()


def _run(workers: list[_Worker], cells: Sequence[C], work: Callable[[C], Figures]) -> Ends[C]:
    """Yield the end of every cell. workers: changed, as processes end and others take their places."""
    waiting = deque(range(len(cells)))
    tries: Counter[int] = Counter()
    try:
        while waiting or any(worker.index is not None for worker in workers):
            for worker in workers:
                if worker.index is None and worker.started and waiting:
                    worker.index = waiting.popleft()
                    _send(worker, cells[worker.index])
            for pipe in wait([worker.pipe for worker in workers]):
                worker = next(one for one in workers if one.pipe is pipe)
                answer = _received(worker)
                if answer == _READY:
                    worker.started = True
                elif answer is not None:
                    index, worker.index = worker.index, None
                    assert index is not None  # noqa: S101 - only a worker with a cell answers
                    yield FinishedCell(index, cells[index], answer.figures, answer.error, answer.took_s)
                else:
                    workers.remove(worker)
                    lost = _lost(worker, cells, tries, waiting)
                    if lost is not None:
                        yield lost
                    if len(workers) < len(waiting) + sum(one.index is not None for one in workers):
                        workers += _start(work, 1)
    finally:
        for worker in [one for one in workers if one.index is not None]:  # abandoned: their answers are of no call
            workers.remove(worker)
            worker.end()


def _lost(worker: _Worker, cells: Sequence[C], tries: Counter[int], waiting: deque[int]) -> FinishedCell[C] | None:
    """Put a dead worker's cell at the end of the queue, or return its end when it has had its tries.

    Raises: WorkerStartError for one that failed before its first cell, or the second one that was killed there.
    """
    said = worker.last_words()
    worker.end()
    if not worker.started:
        tries[UNSTARTED] += 1
        if tries[UNSTARTED] == MAX_TRIES or (worker.process.exitcode or 0) >= 0:  # negative: killed by a signal
            raise WorkerStartError(f"a worker process {said} before its first cell; its own output says why")
    index = worker.index
    if index is None:
        return None
    tries[index] += 1
    if tries[index] < MAX_TRIES:
        waiting.append(index)
        return None
    return FinishedCell(index, cells[index], None, f"its worker process {said}, {MAX_TRIES} times")


def _send(worker: _Worker, cell: object) -> None:
    try:
        worker.pipe.send(cell)
    except OSError:
        return  # it has just died: the next answer of its pipe is its end


def _received(worker: _Worker) -> Any:  # noqa: ANN401 - READY, or the end of a cell
    """Return what a worker says, None when it is gone."""
    try:
        return worker.pipe.recv()
    except (EOFError, OSError):
        return None


def _start(work: Callable[[C], Figures], count: int) -> list[_Worker]:
    """Start processes, one thread each: they share the cores with each other."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    workers = []
    resource_tracker.ensure_running()  # starting it later, with the first process, would let Ctrl-C through again
    with _ctrl_c_waits():
        for _ in range(count):
            ours, theirs = _SPAWN.Pipe()
            process = _SPAWN.Process(target=_work_off, args=(theirs, work), daemon=True)
            process.start()
            theirs.close()
            workers.append(_Worker(process, ours))
    return workers


@contextmanager
def _ctrl_c_waits() -> Iterator[None]:
    """Ignore Ctrl-C in workers that are started in this context, from their first instruction on."""
    if sys.platform == "win32":
        yield
        return
    heard = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, heard)


def _work_off(pipe: Connection, work: Callable[[Any], Figures]) -> None:
    """Run cells until the pipe ends; Ctrl-C is the parent's to handle, and one here is a law's own."""
    STOP_SIGNALS_HELD.hold(lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
    pipe.send(_READY)
    while True:
        try:
            cell = pipe.recv()
        except (EOFError, OSError):
            return  # the parent is gone
        done = finish(0, cell, work)
        try:
            pipe.send(FinishedCell(0, None, done.figures, done.error, done.took_s))
        except OSError:
            return
