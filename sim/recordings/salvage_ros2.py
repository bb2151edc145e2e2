"""Recovery of complete messages from ROS 2 recordings left by a killed recorder, a full disk or a bad card."""

import sqlite3
import struct
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from sim.recordings.salvage import RawMessage

MCAP_MAGIC = b"\x89MCAP0\r\n"
MCAP_RECORD = struct.Struct("<BQ")
MCAP_OP_FOOTER, MCAP_OP_DATA_END = 0x02, 0x0F


@contextmanager
def repaired_mcap(path: Path) -> Iterator[Path]:
    """Provide a temporary copy of an MCAP file with everything up to its last whole record and a proper end.

    A recorder that was killed leaves a file without a footer, often cut in the middle of a chunk.
    """
    content = path.read_bytes()
    position = len(MCAP_MAGIC)
    while position + MCAP_RECORD.size <= len(content):
        operation, length = MCAP_RECORD.unpack_from(content, position)
        following = position + MCAP_RECORD.size + length
        if following > len(content) or operation in {MCAP_OP_FOOTER, MCAP_OP_DATA_END}:
            break
        position = following
    end = MCAP_RECORD.pack(MCAP_OP_DATA_END, 4) + bytes(4) + MCAP_RECORD.pack(MCAP_OP_FOOTER, 20) + bytes(20)
    with tempfile.TemporaryDirectory() as folder:
        repaired = Path(folder) / path.name
        repaired.write_bytes(content[:position] + end + MCAP_MAGIC)
        yield repaired


def rows_before_damage(path: Path) -> Iterator[RawMessage]:
    """Yield the messages of a .db3 in the order in which they were written, up to the first damaged page.

    SQLite refuses a file that is shorter than its header says; with a writable schema (of a file opened for
    reading only) it reads the existing pages. The index is not used: it lies scattered among the pages.
    """
    location = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(location, uri=True)) as database, suppress(sqlite3.DatabaseError):
        database.execute("PRAGMA writable_schema=ON")
        topics = {number: (name, kind) for number, name, kind in database.execute("SELECT id, name, type FROM topics")}
        rows = database.execute("SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY id")
        for number, received_ns, raw in rows:
            if number in topics:
                yield *topics[number], received_ns, raw
