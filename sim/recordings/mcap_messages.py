"""Messages of an MCAP file, each by its own encoding (ROS 2's CDR or ROS 1's), past damage and without the index."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from wallride.runtime.recording.unpacking import MAX_RECORD_B, Unpacking, UnpackingError
from wallride.sim.recordings.messages import WANTED_TYPES, Collector
from wallride.sim.recordings.recording import RecordingError

ROS1: Final = "ros1"
CDR: Final = "cdr"
Decode = Callable[[bytes, str], Any]


def collect_mcap(path: Path, collector: Collector, decoders: dict[str, Decode]) -> str:
    """Collect all that can be read; return why it ends before its end or lacks a piece, "" when it does not.

    decoders: by the encoding of messages. RecordingError when it unpacks to more than its size explains.
    """
    from mcap.stream_reader import StreamReader

    reading = _McapReading(path.stat().st_size, collector, decoders)
    try:
        with path.open("rb") as file:
            for record in StreamReader(file, emit_chunks=True, record_size_limit=MAX_RECORD_B).records:
                reading.take(record)
    except UnpackingError as error:
        raise RecordingError(f"{path}: {error}.") from None
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001 - a parser that meets damage raises anything; the caller reports it
        return str(error).rstrip(".") or "it ends in the middle"
    return reading.damaged


class _McapReading:
    """One pass over a file."""

    def __init__(self, size_bytes: int, collector: Collector, decoders: dict[str, Decode]) -> None:
        self.damaged = ""
        self._unpacking = Unpacking(size_bytes)
        self._collector = collector
        self._decoders = decoders
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, tuple[str, str, str]] = {}

    def take(self, record: object) -> None:
        from mcap import records

        match record:
            case records.Chunk():
                self._take_chunk(record)
            case records.Schema():
                self._schemas[record.id] = record.name
            case records.Channel():
                kind = _ros2_type(self._schemas.get(record.schema_id, ""))
                self._channels[record.id] = record.topic, kind, record.message_encoding
            case records.Message():
                self._take_message(record)

    def _take_chunk(self, chunk: Any) -> None:  # noqa: ANN401 - mcap's
        try:
            for record in self._unpacking.inside(chunk):
                self.take(record)
        except (UnpackingError, MemoryError):
            raise
        except Exception as error:  # noqa: BLE001 - as above; what is behind a damaged chunk is read
            self.damaged = str(error).rstrip(".") or "a damaged piece"

    def _take_message(self, record: Any) -> None:  # noqa: ANN401 - mcap's
        topic, kind, encoding = self._channels.get(record.channel_id, ("", "", ""))
        if kind not in WANTED_TYPES:
            return
        if encoding not in self._decoders:
            self._collector.unreadable[topic] += 1
            self._collector.encodings[topic] = encoding
            return
        try:
            message = self._decoders[encoding](record.data, kind)
        except MemoryError:
            raise
        except Exception:  # noqa: BLE001 - as above; counted and told to the user
            self._collector.unreadable[topic] += 1
        else:
            self._collector.add(topic, kind, record.log_time, message)


def _ros2_type(name: str) -> str:
    package, _, kind = name.partition("/")
    return name if "/" in kind else f"{package}/msg/{kind}"
