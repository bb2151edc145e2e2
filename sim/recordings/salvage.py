"""Recovery of complete messages from ROS 1 bags without index, cut off, or with lost bytes.

A ROS 1 bag (format V2.0) is a chain of records: u32 header length, header, u32 data length, data. A header is a
chain of fields: u32 length, `name=value`. `op` is the kind of the record. Chunks hold records, here read in place.
"""

import re
import struct
from collections.abc import Iterator

U32 = struct.Struct("<I")
TIME = struct.Struct("<II")
MAX_HEADER_BYTES = 4096
OP_FIELD = re.compile(rb"\x04\x00\x00\x00op=")
MAX_STEP_BACK_BYTES = 256
"""Maximum distance before its `op` field at which a record's header is searched."""
OP_MESSAGE, OP_CHUNK, OP_CONNECTION = b"\x02", b"\x05", b"\x07"


Header = dict[bytes, bytes]
RawMessage = tuple[str, str, int, bytes]
"""Topic, ROS 2 type, receive time in ns since 1970, serialized message."""


def whole_messages(bag: bytes) -> Iterator[RawMessage]:
    """Yield every undamaged message, in the file's order.

    A message counts as undamaged when a well-formed record, or the end of the file, follows exactly where its
    length says: lost bytes would have moved it (unless just as many are missing as one record has). After damage
    the next record is looked for. Compressed chunks are skipped.
    """
    records = list(_whole_records(bag))
    topics = _topics(records)
    for header, data in records:
        topic = topics.get(header.get(b"conn", b""))
        time = header.get(b"time", b"")
        if header[b"op"] == OP_MESSAGE and topic is not None and len(time) == TIME.size:
            seconds, nanoseconds = TIME.unpack(time)
            yield *topic, seconds * 10**9 + nanoseconds, data


def _topics(records: list[tuple[Header, bytes]]) -> dict[bytes, tuple[str, str]]:
    """Return topic and type by connection number. A bag repeats them at its end, so either copy will do."""
    topics = {}
    for header, data in records:
        about = _fields(data) if header[b"op"] == OP_CONNECTION else None
        if about is not None and b"type" in about and b"topic" in header:
            topics[header.get(b"conn", b"")] = header[b"topic"].decode(errors="replace"), _ros2_type(about[b"type"])
    return topics


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
    """Return a record's header and the bounds of its data, or None where no complete record lies."""
    found = _header(bag, position)
    if found is None or found[1] + U32.size > len(bag):
        return None
    header, end = found
    data_start = end + U32.size
    data_end = data_start + U32.unpack_from(bag, end)[0]
    is_open_chunk = header[b"op"] == OP_CHUNK
    return (header, data_start, data_end) if data_end <= len(bag) or is_open_chunk else None


def _header(bag: bytes, position: int) -> tuple[Header, int] | None:
    """Return the record header at a position and its end, or None without one."""
    if position + U32.size > len(bag):
        return None
    end = position + U32.size + U32.unpack_from(bag, position)[0]
    if not position + U32.size < end <= min(len(bag), position + MAX_HEADER_BYTES):
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
    """Return the position of the next well-formed record header behind a position, or None."""
    for match in OP_FIELD.finditer(bag, after + 1):
        for start in range(match.start() - U32.size, max(after, match.start() - MAX_STEP_BACK_BYTES), -1):
            found = _header(bag, start)
            if found is not None and found[1] > match.start():
                return start
    return None


def _ros2_type(ros1_type: bytes) -> str:
    package, _, name = ros1_type.decode(errors="replace").partition("/")
    return f"{package}/msg/{name}"
