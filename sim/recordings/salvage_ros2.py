"""Recovery of complete messages from ROS 2 recordings left by a killed recorder, a full disk or a bad card."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

from wallride.sim.recordings.recording import RecordingError
from wallride.sim.recordings.salvage import RawMessage


def check_tables(path: Path) -> None:
    """Refuse a .db3 with a view, which can be without an end, and whose name may have any case; RecordingError."""
    for file in path.glob("*.db3") if path.is_dir() else [path] if path.suffix == ".db3" else []:
        with closing(sqlite3.connect(_location(file), uri=True)) as database, suppress(sqlite3.DatabaseError):
            database.execute("PRAGMA writable_schema=ON")
            for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'view'"):
                raise RecordingError(f"{file}: {name} is a view, not a table as ROS writes it: fetch it again.")


def _location(path: Path) -> str:
    return f"{path.resolve().as_uri()}?mode=ro&immutable=1"


def rows_before_damage(path: Path) -> Iterator[RawMessage]:
    """Yield the messages of a .db3 in the order in which they were written, up to the first damaged page.

    SQLite refuses a file that is shorter than its header says; with a writable schema (of a file opened for
    reading only) it reads the existing pages. The index is not used: it lies scattered among the pages.
    """
    with closing(sqlite3.connect(_location(path), uri=True)) as database, suppress(sqlite3.DatabaseError):
        database.execute("PRAGMA writable_schema=ON")
        topics = {number: (name, kind) for number, name, kind in database.execute("SELECT id, name, type FROM topics")}
        rows = database.execute("SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY id")
        for number, received_ns, raw in rows:
            if number in topics:
                yield *topics[number], received_ns, raw
