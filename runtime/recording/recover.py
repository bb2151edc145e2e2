"""Recovery of a recording that was cut off, because the process was killed or the power failed.

Everything up to the last whole chunk stays unchanged, byte for byte; only the torn end is cut off, and the index and
the footer, without which most tools refuse the file, are written behind it. Idempotent, and safe to interrupt.
"""

import fcntl
import os
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from wallride.runtime.recording.disk import is_being_written, opened
from wallride.runtime.recording.unpacking import Unpacking, UnpackingError

if TYPE_CHECKING:
    from mcap.records import ChunkIndex, MessageIndex

MAGIC = b"\x89MCAP0\r\n"
HEAD_B = 9
"""Length of a record's opcode and length field."""
MAX_TORN_B = 4 << 20
"""Maximum length of a torn end: one unfinished chunk. A longer one is other damage, behind which whole chunks may
lie."""
KNOWN = range(0x01, 0x10)
FOOTER, SCHEMA, CHANNEL, CHUNK, MESSAGE_INDEX, METADATA, DATA_END = 0x02, 0x03, 0x04, 0x06, 0x07, 0x0C, 0x0F


class RecoveryError(Exception):
    """The file was left unchanged; the text gives the reason and the remedy."""


@dataclass(frozen=True, slots=True)
class Recovered:
    """Result of a recovery.

    was_whole: nothing was done. cut_bytes: length of the torn end. damaged: chunks in between that cannot be read.
    """

    messages: int
    chunks: int
    cut_bytes: int
    was_whole: bool
    damaged: int = 0


def is_whole(path: Path) -> bool:
    """Tell whether a file is complete, from its last bytes alone; OSError when it cannot be read."""
    with opened(path) as file:
        length = file.seek(0, os.SEEK_END)
        file.seek(max(len(MAGIC), length - len(MAGIC)))
        return file.read() == MAGIC


def file_state(path: Path) -> str:
    """Return whole, unfinished, recording while it is written, or unreadable."""
    try:
        if is_being_written(path):
            return "recording"
        return "whole" if is_whole(path) else "unfinished"
    except OSError:
        return "unreadable"


def recover(path: Path, breathe: Callable[[], None] = lambda: None) -> Recovered:
    """Finish a file in its place; RecoveryError when that cannot be done. Blocks: reads the whole file.

    breathe: called between two pieces of work, so that other tasks may run in between.
    """
    try:
        with path.open("r+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            found = _Walk(file, path, breathe)
            if found.whole:
                return found.result(0)
            cut_bytes = found.length - found.end
            if cut_bytes > MAX_TORN_B:
                raise RecoveryError(
                    f"{path}: damaged at byte {found.end} of {found.length}, far from its end; mended in place it would"
                    f" lose all behind that. Copy the file first, cut the copy (truncate -s {found.end}) and recover it"
                )
            file.truncate(found.end)
            file.seek(found.end)
            file.write(found.ending())
            file.flush()
            os.fsync(file.fileno())
            return found.result(cut_bytes)
    except BlockingIOError:
        raise RecoveryError(f"{path}: is being written just now; it will be finished when the recording ends") from None
    except OSError as error:
        raise RecoveryError(f"{path}: cannot be recovered: {error.strerror or error}") from None


@dataclass(slots=True)
class _Chunk:
    """A whole chunk: its index, and the positions of each channel's messages in it."""

    index: "ChunkIndex"
    messages: dict[int, list[tuple[int, int]]] = field(default_factory=lambda: defaultdict(list))

    @property
    def is_indexed(self) -> bool:
        """Whether all message indexes behind it are present."""
        return set(self.index.message_index_offsets) == set(self.messages)


class _Walk:
    """One pass over a file from its start to its first torn record.

    end: start of the torn part. whole: there is none, and the file has its footer. damaged: chunks before it that
    cannot be read.
    """

    def __init__(self, file: IO[bytes], path: Path, breathe: Callable[[], None]) -> None:
        from mcap.records import Statistics

        self.length = file.seek(0, os.SEEK_END)
        self._path, self._unpacking = path, Unpacking(self.length)
        file.seek(0)
        if file.read(len(MAGIC)) != MAGIC:
            raise RecoveryError(f"{path}: is not an MCAP file, or was cut before its first byte reached the disk")
        self.end = len(MAGIC)
        self.whole = False
        self.damaged, torn = 0, 0
        self.chunks: list[_Chunk] = []
        self._current: _Chunk | None = None  # the one whose message indexes are being read
        self.schemas: dict[int, Any] = {}
        self.channels: dict[int, Any] = {}
        self.metadata: list[Any] = []
        self.statistics: Statistics = Statistics(0, 0, defaultdict(int), 0, 0, 0, 0, 0, 0)
        for opcode, start, content in self._records(file):
            breathe()
            if opcode == DATA_END:  # the start of an ending; unless all of it is there, it is written anew
                self.whole = _ends_well(file, self.length)
                break
            # A damaged chunk is left out of the index; without a whole one behind it, it is cut off.
            if self._take(opcode, start, content):
                self.end = start + HEAD_B + len(content)
                self.damaged = torn
            elif opcode == CHUNK:
                torn += 1
        self.damaged = torn if self.whole else self.damaged
        last = self.chunks[-1].index if self.chunks else None
        if not self.whole and last is not None and not self.chunks[-1].is_indexed:
            self.end = last.chunk_start_offset + last.chunk_length

    def result(self, cut_bytes: int) -> Recovered:
        """Return what became of the file."""
        return Recovered(self.statistics.message_count, len(self.chunks), cut_bytes, self.whole, self.damaged)

    def ending(self) -> bytes:
        """Return the content to write at `end`: the last chunk's message indexes, summary, footer and magic."""
        from mcap.data_stream import RecordBuilder
        from mcap.records import DataEnd, Footer

        out: Any = RecordBuilder()
        if self.chunks and not self.chunks[-1].is_indexed:
            self._index_last_chunk(out)
        DataEnd(0).write(out)
        summary_start = self.end + out.count
        data = out.end()
        summary = self._summary()
        Footer(summary_start, 0, 0).write(out)
        footer = out.end()[:-4]  # its last field is the sum over the summary and the footer's own other fields
        checksum = zlib.crc32(footer, zlib.crc32(summary))
        return b"".join((data, summary, footer, checksum.to_bytes(4, "little"), MAGIC))

    def _records(self, file: IO[bytes]) -> Iterator[tuple[int, int, bytes]]:
        """Yield opcode, position and content of every complete record."""
        at = len(MAGIC)
        while True:
            head = file.read(HEAD_B)
            length = int.from_bytes(head[1:], "little")
            if len(head) < HEAD_B or head[0] not in KNOWN or at + HEAD_B + length > self.length:
                return
            yield head[0], at, file.read(length)
            at += HEAD_B + length
            file.seek(at)

    def _take(self, opcode: int, start: int, content: bytes) -> bool:
        """Note a record; False when it is damaged, or belongs to a damaged one."""
        from mcap import records
        from mcap.data_stream import ReadDataStream

        stream = ReadDataStream(BytesIO(content))
        try:
            match opcode:
                case _ if opcode == CHUNK:
                    self._current = None
                    self._take_chunk(records.Chunk.read(stream), start, HEAD_B + len(content))
                case _ if opcode == MESSAGE_INDEX:
                    if self._current is None:
                        return False
                    self._take_index(records.MessageIndex.read(stream), start, HEAD_B + len(content))
                case _ if opcode == METADATA:
                    name = records.Metadata.read(stream).name
                    self.metadata.append(records.MetadataIndex(start, HEAD_B + len(content), name))
                    self.statistics.metadata_count += 1
                case _:
                    pass
        except UnpackingError as error:
            raise RecoveryError(f"{self._path}: {error}; it is left as it is") from None
        except Exception:  # noqa: BLE001 - the package raises whatever a torn record leads it to; it is cut off
            return False
        return True

    def _take_chunk(self, chunk: Any, start: int, length: int) -> None:  # noqa: ANN401 - mcap's records are untyped
        from mcap.records import ChunkIndex

        content = self._unpacking.content(chunk)
        index = ChunkIndex(
            chunk_length=length,
            chunk_start_offset=start,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            message_end_time=chunk.message_end_time,
            message_index_length=0,
            message_index_offsets={},
            message_start_time=chunk.message_start_time,
            uncompressed_size=chunk.uncompressed_size,
        )
        found = _Chunk(index)
        self._look_into(content, found)
        self.chunks.append(found)
        self._current = found
        self._count(found)

    def _look_into(self, content: bytes, found: _Chunk) -> None:
        from mcap import records
        from mcap.data_stream import ReadDataStream

        at = 0
        while at < len(content):
            opcode, length = content[at], int.from_bytes(content[at + 1 : at + HEAD_B], "little")
            body = at + HEAD_B
            if opcode == SCHEMA:
                schema = records.Schema.read(ReadDataStream(BytesIO(content[body : body + length])))
                self.schemas[schema.id] = schema
            elif opcode == CHANNEL:
                channel = records.Channel.read(ReadDataStream(BytesIO(content[body : body + length])))
                self.channels[channel.id] = channel
            else:  # a message: channel (2 bytes), sequence (4), log time (8)
                channel_id = int.from_bytes(content[body : body + 2], "little")
                log_time_ns = int.from_bytes(content[body + 6 : body + 14], "little")
                self._unpacking.count()
                found.messages[channel_id].append((log_time_ns, at))
            at = body + length

    def _count(self, found: _Chunk) -> None:
        statistics, index = self.statistics, found.index
        first = statistics.message_count == 0
        for channel_id, places in found.messages.items():
            statistics.channel_message_counts[channel_id] += len(places)
            statistics.message_count += len(places)
        earliest_ns, latest_ns = index.message_start_time, index.message_end_time
        statistics.message_start_time = earliest_ns if first else min(statistics.message_start_time, earliest_ns)
        statistics.message_end_time = max(statistics.message_end_time, latest_ns)
        statistics.chunk_count += 1

    def _take_index(self, index: "MessageIndex", start: int, length: int) -> None:
        chunk = self.chunks[-1].index
        chunk.message_index_offsets[index.channel_id] = start
        chunk.message_index_length += length

    def _index_last_chunk(self, out: Any) -> None:  # noqa: ANN401 - mcap's builder is untyped
        from mcap.records import MessageIndex

        last = self.chunks[-1]
        last.index.message_index_offsets.clear()
        for channel_id, places in last.messages.items():
            last.index.message_index_offsets[channel_id] = self.end + out.count
            MessageIndex(channel_id, places).write(out)
        last.index.message_index_length = out.count

    def _summary(self) -> bytes:
        from mcap.data_stream import RecordBuilder

        out: Any = RecordBuilder()
        self.statistics.schema_count, self.statistics.channel_count = len(self.schemas), len(self.channels)
        everything = (
            *self.schemas.values(), *self.channels.values(), self.statistics,
            *(chunk.index for chunk in self.chunks), *self.metadata,
        )  # fmt: skip
        for record in everything:
            record.write(out)
        return bytes(out.end())


def _ends_well(file: IO[bytes], length: int) -> bool:
    file.seek(length - len(MAGIC))
    return file.read() == MAGIC
