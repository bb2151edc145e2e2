"""One MCAP file that is readable wherever it is cut off.

The package `mcap` makes the bytes; this module writes them to the disk in small chunks, forced to it at every `flush`.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Self

from wallride.runtime.recording.channels import RecordMessage, schema_text
from wallride.runtime.recording.disk import Disk

PROFILE = "ros2"
METADATA = "wallride"
CHUNK_B = 48 << 10
"""Length at which a chunk is closed; with the last message it stays below 64 KiB."""
SEQUENCE_MASK = 0xFFFFFFFF


class McapFile:
    """A file being written. Every method may raise OSError; the file is then given up with `abandon`.

    bytes_written: bytes accepted by the disk. shift_ns: added to every stamp. begin_ns: before the shift; earlier
        messages are logged at this time and keep their own as time of publication.
    """

    def __init__(
        self, path: Path, disk: Disk, facts: Mapping[str, str], library: str, *, shift_ns: int = 0, begin_ns: int = 0
    ) -> None:
        from mcap.writer import CompressionType, Writer  # slow to import; not before there is something to write

        self.path = path
        self.messages = 0
        self.shift_ns = shift_ns
        self._begin_ns = begin_ns
        self._disk = disk
        self._spool = _Spool()
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        # Noise does not compress, and compressing would hold the interpreter's lock for longer.
        self._writer: Any = Writer(self._spool, chunk_size=CHUNK_B, compression=CompressionType.NONE)  # type: ignore[arg-type]
        _pack_index(self._writer)
        self._writer.start(PROFILE, library)
        self._writer.add_metadata(METADATA, dict(facts))
        self._descriptor = disk.create(path)

    @property
    def bytes_written(self) -> int:
        """Bytes accepted by the disk."""
        return self._spool.taken

    @property
    def bytes_waiting(self) -> int:
        """Bytes of complete chunks that the disk has not been given."""
        return len(self._spool.waiting)

    def add(self, message: RecordMessage) -> None:
        """Add a message; it reaches the disk with the next `flush`."""
        channel = self._channels.get(message.topic)
        if channel is None:
            channel = self._channels[message.topic] = self._register(message)
        log_ns = max(message.stamp_ns, self._begin_ns) + self.shift_ns
        published_ns = message.stamp_ns + self.shift_ns
        self._writer.add_message(channel, log_ns, message.payload, published_ns, message.sequence & SEQUENCE_MASK)
        self.messages += 1

    def write(self) -> None:
        """Write all complete chunks, without forcing them to the disk."""
        while self._spool.waiting:
            with memoryview(self._spool.waiting) as waiting:
                taken = self._disk.write(self._descriptor, waiting)
            self._spool.take(taken)

    def flush(self) -> None:
        """Close the chunk and force everything to the disk: all messages added before survive a power cut now."""
        self._writer.flush()
        self.write()
        self._disk.sync(self._descriptor)

    def close(self) -> None:
        """Write index and footer and close the file."""
        self._writer.finish()
        self.write()
        self._disk.sync(self._descriptor)
        self._disk.close(self._descriptor)

    def is_there(self) -> bool:
        """Tell whether the file is still at its path, with all that was written."""
        return self._disk.has(self._descriptor, self.path, self.bytes_written)

    def abandon(self) -> None:
        """Close the file as it is; `recover` can finish it later."""
        self._disk.close(self._descriptor)

    def _register(self, message: RecordMessage) -> int:
        schema = self._schemas.get(message.schema)
        if schema is None:
            text = schema_text(message.schema).encode()
            schema = self._schemas[message.schema] = self._writer.register_schema(message.schema, "ros2msg", text)
        return int(self._writer.register_channel(f"/{message.topic}", "cdr", schema, {"offered_qos_profiles": ""}))


def _pack_index(writer: Any) -> None:  # noqa: ANN401 - the package's writer
    """Have a writer keep its index as bytes; a version of the package that names it otherwise keeps objects."""
    writer._Writer__chunk_indices = _PackedIndexes()  # noqa: SLF001


class _PackedIndexes:
    """The records of all chunks that end a file, as bytes, in place of the package's list of objects.

    As objects those of 256 MB take 8 MB, which the process keeps from its first file on.
    """

    def __init__(self) -> None:
        from mcap.data_stream import RecordBuilder

        self._records: Any = RecordBuilder()

    def append(self, index: Any) -> None:  # noqa: ANN401 - one of the package's records
        index.write(self._records)

    def __iter__(self) -> Iterator[Self]:
        yield self

    def write(self, builder: Any) -> None:  # noqa: ANN401 - the package's builder of the summary
        builder.write(self._records.end())


class _Spool:
    """Buffer between the mcap writer and the disk."""

    def __init__(self) -> None:
        self.waiting = bytearray()
        self.taken = 0

    def write(self, data: bytes) -> int:
        self.waiting += data
        return len(data)

    def tell(self) -> int:
        return self.taken + len(self.waiting)

    def flush(self) -> None:
        """Do nothing: the buffer is drained by `take`."""

    def take(self, taken: int) -> None:
        del self.waiting[:taken]
        self.taken += taken
