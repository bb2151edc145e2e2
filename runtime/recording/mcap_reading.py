"""Reader of MCAP files, also of torn, damaged and foreign ones: all that can be read, in the order of the file."""

from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.recording.unpacking import MAX_RECORD_B, Unpacking, UnpackingError


class LoggedRecord(NamedTuple):
    """A message. topic: as written; schema: its type, "" where it is not known; record: mcap's."""

    topic: str
    schema: str
    encoding: str
    record: Any


class FileFacts(NamedTuple):
    """A record of metadata."""

    name: str
    values: dict[str, str]


class Damage(NamedTuple):
    """A piece that cannot be read: a chunk, of a duration, or with is_end all that is behind."""

    reason: str
    is_end: bool
    duration_s: float = 0.0


class McapReader:
    """Yields messages, metadata and damage. UnpackingError for a bomb; OSError where the disk fails."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, tuple[str, str, str]] = {}
        self._is_damaged = False

    def __iter__(self) -> Iterator[LoggedRecord | FileFacts | Damage]:
        """Read from the beginning, as far as it can be read."""
        from mcap.records import Chunk
        from mcap.stream_reader import StreamReader

        with self._path.open("rb") as file:
            unpacking = Unpacking(self._path.stat().st_size)
            try:
                for record in StreamReader(file, emit_chunks=True, record_size_limit=MAX_RECORD_B).records:
                    yield from self._inside(record, unpacking, file) if isinstance(record, Chunk) else self._in(record)
            except (UnpackingError, MemoryError, OSError):
                raise
            except Exception as error:  # noqa: BLE001 - a parser that meets damage raises anything; readers are told
                yield Damage(_reason(error), is_end=True)

    def _inside(self, chunk: Any, unpacking: Unpacking, file: IO[bytes]) -> Iterator[LoggedRecord | FileFacts | Damage]:  # noqa: ANN401 - mcap's
        try:
            for record in unpacking.inside(chunk):
                yield from self._in(record)
        except (UnpackingError, MemoryError):
            raise
        except Exception as error:  # noqa: BLE001 - as above
            if not self._is_damaged:  # the types may stand in this chunk alone
                self._is_damaged = True
                for known in _types_at_end(file):
                    yield from self._in(known)
            duration_s = (chunk.message_end_time - chunk.message_start_time) / NS
            yield Damage(_reason(error), is_end=False, duration_s=duration_s)

    def _in(self, record: object) -> Iterator[LoggedRecord | FileFacts]:
        from mcap import records

        match record:
            case records.Schema():
                self._schemas[record.id] = record.name
            case records.Channel():
                schema = self._schemas.get(record.schema_id, "")
                self._channels[record.id] = record.topic, schema, record.message_encoding
            case records.Message() if record.channel_id in self._channels:
                yield LoggedRecord(*self._channels[record.channel_id], record)
            case records.Metadata():
                yield FileFacts(record.name, dict(record.metadata))


def _reason(error: Exception) -> str:
    return str(error).rstrip(".") or "its end is missing"


def _types_at_end(file: IO[bytes]) -> list[Any]:
    """Return the schemas and channels that the end of a whole file repeats; the position in the file stays."""
    from mcap.reader import SeekingReader

    at = file.tell()
    file.seek(0)
    try:
        summary = SeekingReader(file, record_size_limit=MAX_RECORD_B).get_summary()
    except Exception:  # noqa: BLE001 - as above: a torn one has none
        summary = None
    file.seek(at)
    return [*summary.schemas.values(), *summary.channels.values()] if summary is not None else []
