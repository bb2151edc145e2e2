"""Saves what is whole in damaged recordings: ROS 1 bags without index or with lost bytes, MCAP files of a crash.

A ROS 1 bag (format V2.0) is a chain of records: u32 header length, header, u32 data length, data. A header is a
chain of fields: u32 length, `name=value`. `op` says what the record is. Chunks hold records, here read in place.
"""

import re
import struct
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

U32 = struct.Struct("<I")
LONGEST_HEADER_BYTES = 4096
OP_FIELD = re.compile(rb"\x04\x00\x00\x00op=")
LONGEST_STEP_BACK_BYTES = 256
"""How far before its `op` field a record's header is looked for."""
OP_MESSAGE, OP_CHUNK, OP_CONNECTION = b"\x02", b"\x05", b"\x07"

MCAP_MAGIC = b"\x89MCAP0\r\n"
MCAP_RECORD = struct.Struct("<BQ")
MCAP_OP_FOOTER, MCAP_OP_DATA_END = 0x02, 0x0F

Header = dict[bytes, bytes]


def whole_messages(bag: bytes) -> Iterator[tuple[str, str, int, bytes]]:
    """Yield (topic, type, receive time in ns, raw message) of every undamaged message, in the file's order.

    A message counts as undamaged when a well-formed record, or the end of the file, follows exactly where its
    length says: lost bytes would have moved it. After damage the next record is looked for. Compressed chunks
    are passed over.
    """
    topics: dict[bytes, tuple[str, str]] = {}
    for header, data in _whole_records(bag):
        operation = header[b"op"]
        if operation == OP_CONNECTION:
            about = _fields(data)
            if about is not None and b"type" in about and b"topic" in header:
                topics[header.get(b"conn", b"")] = header[b"topic"].decode(errors="replace"), _ros2_type(about[b"type"])
        elif (
            operation == OP_MESSAGE and header.get(b"conn") in topics and len(header.get(b"time", b"")) == 2 * U32.size
        ):
            seconds, nanoseconds = struct.unpack("<II", header[b"time"])
            yield *topics[header[b"conn"]], seconds * 10**9 + nanoseconds, data


def _whole_records(bag: bytes) -> Iterator[tuple[Header, bytes]]:
    position: int | None = bag.find(b"\n") + 1
    while position is not None:
        record = _record(bag, position)
        if record is None:
            position = _next_record(bag, position)
            continue
        header, data_start, data_end = record
        if header[b"op"] == OP_CHUNK and header.get(b"compression") == b"none":
            position = data_start
        elif data_end == len(bag) or _header(bag, data_end) is not None:
            yield header, bag[data_start:data_end]
            position = data_end
        else:
            position = _next_record(bag, data_start)


def _record(bag: bytes, position: int) -> tuple[Header, int, int] | None:
    """Return a record's header and where its data start and end, or None where no whole record lies."""
    found = _header(bag, position)
    if found is None or found[1] + U32.size > len(bag):
        return None
    header, end = found
    data_start = end + U32.size
    data_end = data_start + U32.unpack_from(bag, end)[0]
    is_open_chunk = header[b"op"] == OP_CHUNK
    return (header, data_start, data_end) if data_end <= len(bag) or is_open_chunk else None


def _header(bag: bytes, position: int) -> tuple[Header, int] | None:
    """Return the record header at a position and where it ends, or None where there is none."""
    if position + U32.size > len(bag):
        return None
    end = position + U32.size + U32.unpack_from(bag, position)[0]
    if not position + U32.size < end <= min(len(bag), position + LONGEST_HEADER_BYTES):
        return None
    header = _fields(bag[position + U32.size : end])
    return (header, end) if header is not None and len(header.get(b"op", b"")) == 1 else None


def _fields(block: bytes) -> Header | None:
    """Split a chain of fields, or return None where the lengths do not add up."""
    fields: Header = {}
    position = 0
    while position < len(block):
        if position + U32.size > len(block):
            return None
        start = position + U32.size
        position = start + U32.unpack_from(block, position)[0]
        name, equals, value = block[start:position].partition(b"=")
        if position > len(block) or not equals:
            return None
        fields[name] = value
    return fields


def _next_record(bag: bytes, after: int) -> int | None:
    """Return where the next well-formed record header starts behind a position, or None."""
    for match in OP_FIELD.finditer(bag, after + 1):
        for start in range(match.start() - U32.size, max(after, match.start() - LONGEST_STEP_BACK_BYTES), -1):
            found = _header(bag, start)
            if found is not None and found[1] > match.start():
                return start
    return None


def _ros2_type(ros1_type: bytes) -> str:
    package, _, name = ros1_type.decode(errors="replace").partition("/")
    return f"{package}/msg/{name}"


@contextmanager
def repaired_mcap(path: Path) -> Iterator[Path]:
    """Lend a copy of an MCAP file with everything up to its last whole record and a proper end.

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
