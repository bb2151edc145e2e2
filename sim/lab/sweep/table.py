"""Table of runs: SQLite, one row for each cell, code and conditions, so that a run counts exactly once.

A row is committed as soon as its run has ended; a command that is killed loses none. WAL: others may read meanwhile.
"""

import fcntl
import hashlib
import json
import sqlite3
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from wallride.sim.lab.cell import Figures
from wallride.sim.lab.sweep.drive_cell import DriveCell
from wallride.sim.lab.workers.finished_cell import FinishedCell

SCHEMA = """
CREATE TABLE IF NOT EXISTS runs (
    cell_key TEXT NOT NULL, version TEXT NOT NULL, settings_hash TEXT NOT NULL,
    cell TEXT NOT NULL, figures TEXT, error TEXT NOT NULL, took_s REAL NOT NULL, ended_unix_s REAL NOT NULL,
    PRIMARY KEY (cell_key, version, settings_hash)
) WITHOUT ROWID"""
_ROOT = Path(__file__).resolve().parents[3]
_CODE = ("drivers", "runtime", "sim")
_MAGIC = b"SQLite format 3\0"


class TableError(Exception):
    """A table cannot be used; the text says why."""


@dataclass(frozen=True, slots=True)
class RunKey:
    """Name of a run: the cell, the code that ran it, the conditions that the cell does not name."""

    cell_key: str
    version: str
    settings_hash: str


@dataclass(frozen=True, slots=True)
class TableRun:
    """One run. values: of its cell. figures: {} where it failed. error: "" or why."""

    values: Mapping[str, Any]
    figures: Mapping[str, Any]
    error: str

    def row(self) -> dict[str, Any]:
        """Return all of it flat, for a file."""
        return {**self.values, **self.figures, "error": self.error}


@lru_cache(maxsize=1)
def code_version() -> str:
    """Return wallride's version with a hash of the sources that decide a run."""
    code = hashlib.sha256()
    for package in _CODE:
        for path in sorted((_ROOT / package).rglob("*")):
            if path.suffix in {".py", ".c", ".h"}:
                code.update(f"{path.relative_to(_ROOT)}\0".encode() + path.read_bytes())
    return f"{version('wallride')}+{code.hexdigest()[:12]}"


def is_table(path: Path) -> bool:
    """Return whether a file is an SQLite one."""
    try:
        with path.open("rb") as file:
            return file.read(len(_MAGIC)) == _MAGIC
    except OSError:
        return False


class RunTable:
    """The runs of one file."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def known(self) -> set[RunKey]:
        """Return the keys of all rows."""
        return {RunKey(*row) for row in self._connection.execute("SELECT cell_key, version, settings_hash FROM runs")}

    def add(self, key: RunKey, done: FinishedCell[DriveCell]) -> None:
        """Write the end of a run; a run that is there stays as it is."""
        figures = None if done.figures is None else json.dumps(done.figures, allow_nan=False)
        row = (done.cell.text, figures, done.error, round(done.took_s, 4), round(time.time(), 3))
        with self._connection:
            self._connection.execute(
                "INSERT OR IGNORE INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (key.cell_key, key.version, key.settings_hash, *row),
            )

    def forget_failed(self) -> int:
        """Delete the runs that failed, and return their number."""
        with self._connection:
            return self._connection.execute("DELETE FROM runs WHERE error != ''").rowcount

    def runs(self, keys: Sequence[RunKey] | None = None) -> list[TableRun]:
        """Return runs in the order of the keys; None: the newest run of every cell, in order of the cells' keys."""
        found: dict[RunKey, TableRun] = {}
        query = (
            "SELECT cell_key, version, settings_hash, cell, figures, error FROM runs ORDER BY ended_unix_s, cell_key"
        )
        for cell_key, of_version, settings_hash, cell, figures, error in self._connection.execute(query):
            read: Figures = json.loads(figures) if figures else {}
            found[RunKey(cell_key, of_version, settings_hash)] = TableRun(json.loads(cell), read, error)
        if keys is not None:
            return [found[key] for key in keys if key in found]
        newest = {key.cell_key: run for key, run in found.items()}
        return [newest[cell_key] for cell_key in sorted(newest)]


@contextmanager
def open_table(path: Path, *, writes: bool) -> Iterator[RunTable]:
    """Open a table; TableError where it is another file, or another command is filling it."""
    if path.exists() and path.stat().st_size and not is_table(path):
        raise TableError(f"{path}: is not a table of runs (SQLite); name another file")
    if not writes and not path.is_file():
        raise TableError(f"{path}: no such file")
    if not path.absolute().parent.is_dir():
        raise TableError(f"{path}: there is no directory {path.parent}; make it first")
    with path.open("ab" if writes else "rb") as lock:
        if writes:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise TableError(f"{path}: another command is filling it; wait for its end") from None
        connection = sqlite3.connect(path, timeout=10.0)
        try:
            if writes:
                connection.execute("PRAGMA journal_mode=WAL")
                connection.execute("PRAGMA synchronous=NORMAL")
            connection.execute(SCHEMA)
            yield RunTable(connection)
        except sqlite3.DatabaseError as error:
            raise TableError(f"{path}: {error}") from None
        finally:
            connection.close()


def run_key(cell: DriveCell, settings_hash: str) -> RunKey:
    """Return the key of a run by this code."""
    return RunKey(cell.key, code_version(), settings_hash)


def columns(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the names of all columns, in order of appearance, "error" last."""
    names = dict.fromkeys(name for row in rows for name in row if name != "error")
    return [*names, "error"]
