"""Runs the cells of an experiment on all cores, with a progress bar, and stops at once on Ctrl-C."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from wallride.sim.lab.cell import Cell, Experiment, Figures, module_of
from wallride.sim.lab.workers.finished_cell import Ends
from wallride.sim.lab.workers.submit import submit

C = TypeVar("C")


class CellFailedError(RuntimeError):
    """A cell of an experiment failed: a bug of the experiment, or the end of a process by a law of the user's."""


@dataclass(frozen=True, slots=True)
class Measuring:
    """The work on a cell. plots: directory for its picture, or None."""

    plots: Path | None

    def __call__(self, cell: Cell) -> Figures:
        """Return the figures of a cell."""
        chosen = experiment(cell.experiment)
        figures = cell.named(chosen.measure(cell))
        if self.plots is not None:
            from wallride.sim.lab.picture import save

            (chosen.plot or save)(self.plots, cell, figures)
        return figures


def experiment(name: str) -> Experiment:
    """Return an experiment by its name."""
    found: Experiment = module_of(name).EXPERIMENT
    return found


@contextmanager
def progress_bar(title: str, total: int, console: Console) -> Iterator[tuple[Progress, TaskID]]:
    """Show a progress bar meanwhile; `advance` of the first on the second moves it on."""
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=True) as progress:
        yield progress, progress.add_task(title, total=total)


def measure_all(cells: Sequence[Cell], jobs: int | None, plots: Path | None, console: Console) -> list[Figures]:
    """Return the figures of every cell, in their order; CellFailedError ends everything at once.

    KeyboardInterrupt ends all processes; nothing is left running.
    """
    with progress_bar(cells[0].experiment, len(cells), console) as (progress, bar):
        return in_order(submit(cells, Measuring(plots), jobs=jobs), lambda: progress.advance(bar))


def in_order(ends: Ends[C], advance: Callable[[], None] = lambda: None) -> list[Figures]:
    """Return the figures of all cells in their order; CellFailedError abandons the rest. advance: after each."""
    measured: dict[int, Figures] = {}
    with closing(ends) as ended:
        for done in ended:
            if done.figures is None:
                raise CellFailedError(f"{done.cell}: {done.error}")
            measured[done.index] = done.figures
            advance()
    return [measured[index] for index in range(len(measured))]
