"""Parts of every experiment: a cell is one run of its table, small enough to be sent to another process."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from wallride.sim.world.own_parts import kind_of
from wallride.sim.world.pose import Side

DESIRED_M = 1.0
"""Distance to the wall that is requested by default."""
WITH_OWN_PARTS = ("walls", "safety", "hazards", "laps")
"""Experiments in whose runs a car may see parts of itself."""
Figures = dict[str, Any]
"""The figures of a cell: numbers, booleans, short texts and None, as they go into the JSON file."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One run. law: a name of `wallride.sim.lab.laws`. speed_mps: the requested speed; the law may choose less.

    desired_m: requested distance to the wall. own_parts: of the car, see `wallride.sim.world.own_parts`. settings:
    KEY=VALUE texts on top of the default settings. conditions: of the simulated car, on top of the course's own, as
    `wallride.sim.scenario.conditions.named_conditions` returns them.
    """

    experiment: str
    scenario: str
    law: str
    speed_mps: float
    mu: float
    side: Side
    seed: int
    desired_m: float = DESIRED_M
    own_parts: str = "none"
    settings: tuple[str, ...] = ()
    conditions: tuple[str, ...] = ()

    def named(self, figures: Figures) -> Figures:
        """Return the figures with the cell's own names in front."""
        return {**asdict(self), **figures}


def course_name(scenario: str) -> str:
    """Return the short name of a course: of a map or a recording the file's name alone."""
    return Path(scenario).stem if "/" in scenario or scenario.endswith(".yaml") else scenario


@dataclass(frozen=True, slots=True)
class CellChoice:
    """Selection of runs. own_parts: of every car; "": none on every other seed, the kinds in turn between."""

    laws: tuple[str, ...]
    speeds_mps: tuple[float, ...]
    mus: tuple[float, ...]
    sides: tuple[Side, ...]
    seeds: tuple[int, ...]
    quick: bool = False
    maps: tuple[str, ...] = ()
    recordings: tuple[str, ...] = ()
    desired_m: float = DESIRED_M
    generated: bool = False
    """Courses generated from the seeds instead of the named ones."""
    own_parts: str = ""
    settings: tuple[str, ...] = ()
    conditions: tuple[str, ...] = ()

    def cells(self, experiment: str, scenarios: Sequence[str]) -> list[Cell]:
        """Return every combination; the longest runs first, so that no core waits for one at the end."""
        cells = [
            Cell(
                experiment,
                scenario,
                law,
                speed_mps,
                mu,
                side,
                seed,
                self.desired_m,
                self._parts(experiment, seed),
                self.settings,
                self.conditions,
            )
            for speed_mps in self.speeds_mps
            for scenario in scenarios
            for law in self.laws
            for mu in self.mus
            for side in self.sides
            for seed in self.seeds
        ]
        return sorted(cells, key=lambda cell: cell.speed_mps)

    def _parts(self, experiment: str, seed: int) -> str:
        return self.own_parts or (kind_of(seed) if experiment in WITH_OWN_PARTS else "none")


@dataclass(frozen=True, slots=True)
class TabledCell:
    """Table for the terminal."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Experiment:
    """An experiment. cells: its runs. measure: runs one. tables: the tables of all figures.

    Without cells and tables: its runs are those of a study or a report. plot: draws a cell into a directory; None draws
    its path, from `run` of the experiment's module.
    """

    measure: Callable[[Cell], Figures]
    cells: Callable[[CellChoice], list[Cell]] = lambda _: []
    tables: Callable[[Sequence[Mapping[str, Any]]], list[TabledCell]] = lambda _: []
    plot: Callable[[Path, Cell, Figures], None] | None = None


def module_of(name: str) -> ModuleType:
    """Return the module of an experiment: of the lab, or of the benchmarks where its name says so."""
    return import_module(name if name.startswith("benchmarks.") else f"wallride.sim.lab.{name}")
