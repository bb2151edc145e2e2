"""The two sides of a comparison: a table, a part of one, a sweep's file, or a settings file below a sweep."""

import json
import re
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from wallride.sim.lab.compare.pairs import ComparisonError
from wallride.sim.lab.sweep.command import Workers, fill, keys_of
from wallride.sim.lab.sweep.plan import GRID, RANDOM, SEEDS, read_plan
from wallride.sim.lab.sweep.table import TableRun, is_table, open_table
from wallride.sim.scenario.toml_lines import read_toml

_SELECTED = re.compile(r"(.+\.(?:sqlite|db|toml)):([^:=]+=.+)")
_OF_SWEEPS = frozenset({"world", SEEDS, GRID, RANDOM, "law", "duration_s"})


@dataclass(frozen=True, slots=True)
class SideMaker:
    """Makes a side of a comparison. sweep: for settings files. jobs: as of `submit`."""

    sweep: Path | None
    jobs: int | None
    console: Console

    def runs(self, text: str) -> list[TableRun]:
        """Return the runs of FILE or FILE:NAME=VALUE,NAME=VALUE; what is missing of a sweep is run first.

        Raises ComparisonError, FileMistakeError or TableError for a file that cannot be used.
        """
        found = _SELECTED.fullmatch(text)
        file, wanted = (Path(found.group(1)), found.group(2).split(",")) if found else (Path(text), [])
        if not file.is_file():
            raise ComparisonError(f"{file}: no such file; give a table, a sweep or a settings file")
        if is_table(file):
            with open_table(file, writes=False) as table:
                runs = table.runs()
        else:
            runs = self._swept(file)
        for selection in wanted:
            name, _, value = selection.partition("=")
            runs = [run for run in runs if _is(run, name.strip(), value.strip())]
            if not runs:
                raise ComparisonError(f"{file}: no run has {name.strip()} = {value.strip()}")
        return runs

    def _swept(self, file: Path) -> list[TableRun]:
        """Return the runs of a sweep, or of a settings file below the sweep of the options."""
        if not _OF_SWEEPS & read_toml(file).tree.keys():
            if self.sweep is None:
                raise ComparisonError(f"{file}: is a settings file; name the drives to compare it in with --sweep FILE")
            plan = read_plan(self.sweep, {"config": str(file.absolute())})
        else:
            plan = read_plan(file)
        with open_table(plan.text.path.with_suffix(".sqlite"), writes=True) as table:
            keys = list(keys_of(plan))
            fill(table, plan, keys, Workers(self.jobs), self.console)
            return table.runs(keys)


def _is(run: TableRun, name: str, value: str) -> bool:
    """Return whether a run has a value, written as text or as JSON."""
    if name not in run.values:
        return False
    has = run.values[name]
    try:
        return bool(has == json.loads(value)) or has == value
    except ValueError:
        return bool(has == value)
