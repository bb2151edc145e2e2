"""Process pool: runs cells on all cores, with a progress bar, and stops at once on Ctrl-C."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sim.lab.cell import Cell, Experiment, Figures

EXPERIMENTS = (
    "walls", "corners", "safety", "hazards", "laps", "window", "covers", "rooms", "recordings", "stories",
)  # fmt: skip


def experiment(name: str) -> Experiment:
    """Return an experiment by its name."""
    found: Experiment = import_module(f"sim.lab.{name}").EXPERIMENT
    return found


def measure_all(cells: Sequence[Cell], jobs: int | None, plots: Path | None, console: Console) -> list[Figures]:
    """Return the figures of every cell, in their order.

    KeyboardInterrupt ends all processes; nothing is left running.
    """
    jobs = min(jobs or os.cpu_count() or 1, len(cells))
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task(cells[0].experiment, total=len(cells))
        if jobs == 1:
            figures = []
            for cell in cells:
                figures.append(_measured(cell, plots))
                progress.advance(bar)
            return figures
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(jobs, mp_context=spawn, initializer=_start_worker) as pool:
            with _ctrl_c_waits():
                futures = [pool.submit(_measured, cell, plots) for cell in cells]
            try:
                for future in as_completed(futures):
                    future.result()  # an error ends everything at once
                    progress.advance(bar)
                return [future.result() for future in futures]
            except BaseException:
                _abandon(futures, pool)
                raise


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


def _measured(cell: Cell, plots: Path | None) -> Figures:
    chosen = experiment(cell.experiment)
    figures = cell.named(chosen.measure(cell))
    if plots is not None:
        from sim.lab.picture import save

        (chosen.plot or save)(plots, cell, figures)
    return figures


def _start_worker() -> None:
    """Ignore Ctrl-C, which the parent handles, and leave the cores to the other workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _abandon(futures: Sequence[Future[Figures]], pool: ProcessPoolExecutor) -> None:
    for future in futures:
        future.cancel()
    pool.shutdown(wait=True, cancel_futures=True)  # the few runs under way take a second or two
