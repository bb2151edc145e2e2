"""Reader of wallride's own recordings: MCAP with the car's topics, whole or cut off at any byte.

The messages of an incomplete chunk are lost; everything before and, where chunks follow, behind it is kept, and the
notes state how much is missing.
"""

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wallride.runtime.recording.channels import SETTINGS, STRING, TAPE, text_of
from wallride.runtime.recording.mcap_file import METADATA
from wallride.runtime.recording.unpacking import MAX_RECORD_B, Unpacking, UnpackingError, types_at_end
from wallride.runtime.ros.definitions import definition
from wallride.sim.recordings import RecordingError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

NS = 1_000_000_000
MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True, slots=True)
class LoggedMessage:
    """One message as recorded.

    schema: ROS 2 type, "" for text, which is out of its std_msgs/String already. stamp_ns: since 1970, its
    log time. sequence: of a scan, the scan's own number.
    """

    topic: str
    schema: str
    stamp_ns: int
    payload: bytes
    sequence: int = 0


@dataclass(eq=False)
class DriveLog:
    """Everything of one file, in the file's order.

    metadata: by record name, as written when the recording began. notes: sentences about missing data.
    """

    name: str
    messages: list[LoggedMessage] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @cached_property
    def by_topic(self) -> Mapping[str, list[LoggedMessage]]:
        """Return the messages by topic, names without outer slashes."""
        topics: dict[str, list[LoggedMessage]] = {}
        for message in self.messages:
            topics.setdefault(message.topic, []).append(message)
        return topics

    def of(self, topic: str) -> list[LoggedMessage]:
        """Return a topic's messages in order, none where it was not recorded."""
        return self.by_topic.get(topic, [])

    def json(self, topic: str) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield log time [ns] and fields of every readable message of a JSON topic."""
        for message in self.of(topic):
            try:
                fields = json.loads(message.payload)
            except ValueError:
                continue
            if isinstance(fields, dict):
                yield message.stamp_ns, fields

    @property
    def settings_text(self) -> str:
        """Return the settings in force at the beginning, as TOML; "" if they were not recorded."""
        first = next(iter(self.of(SETTINGS)), None)
        return first.payload.decode(errors="replace") if first is not None else self.fact(SETTINGS)

    def fact(self, name: str) -> str:
        """Return a value of the metadata whatever its record's name, "" where there is none."""
        return next((values[name] for values in self.metadata.values() if name in values), "")

    @property
    def is_ours(self) -> bool:
        """Return whether this is a recording of wallride, not of another program."""
        return METADATA in self.metadata or TAPE in self.by_topic or {"status", "decision"} <= set(self.by_topic)


def is_mcap(path: Path) -> bool:
    """Return whether a file begins as an MCAP file; RecordingError when it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except IsADirectoryError:
        return False
    except OSError as error:
        raise RecordingError(f"{path} cannot be opened: {error.strerror or error}.") from error


def read_log(path: Path, until: str | None = None) -> DriveLog:
    """Return all complete data of an MCAP file; RecordingError when there is none.

    until: a topic; little more is read than up to its first message.
    """
    log = DriveLog(path.stem)
    reading = _Reading(log)
    try:
        with path.open("rb") as file:
            reading.read(file, path.stat().st_size, until)
    except UnpackingError as error:
        raise RecordingError(f"{path}: {error}.") from None
    except ModuleNotFoundError as error:
        raise RecordingError(
            f"{path} needs the package {error.name}: install wallride with its extra [sim]."
        ) from error
    except OSError as error:
        raise RecordingError(f"{path} cannot be opened: {error.strerror or error}.") from error
    if not log.messages:
        why = f" ({'; '.join(log.notes)})" if log.notes else ""
        raise RecordingError(f"{path} holds no message{why}: choose another recording.")
    return log


class _Reading:
    """One pass over a file."""

    def __init__(self, log: DriveLog) -> None:
        self._log = log
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, tuple[str, str]] = {}
        self._damaged: Counter[str] = Counter()
        self._unpacking = Unpacking(0)
        self._file: Any = None

    def read(self, file: Any, size_bytes: int, until: str | None) -> None:  # noqa: ANN401 - mcap takes any binary file
        from mcap.stream_reader import StreamReader

        self._unpacking, self._file = Unpacking(size_bytes), file
        reader = StreamReader(file, emit_chunks=True, record_size_limit=MAX_RECORD_B)
        try:
            for record in reader.records:
                self._take(record)
                if until is not None and any(message.topic == until for message in self._log.messages):
                    break
        except UnpackingError:
            raise
        except Exception as error:  # noqa: BLE001 - a parser that meets damage raises anything; told to the user
            reason = str(error).rstrip(".") or type(error).__name__
            self._log.notes.append(
                f"{self._log.name} ends in the middle ({reason}): {len(self._log.messages)} messages were saved."
            )
        if damaged := sum(self._damaged.values()):
            self._log.notes.append(f"{damaged} damaged pieces are left out ({', '.join(self._damaged)}).")

    def _take(self, record: object) -> None:
        from mcap import records

        match record:
            case records.Chunk():
                self._open_chunk(record)
            case records.Schema():
                self._schemas[record.id] = record.name
            case records.Channel():
                is_cdr = record.message_encoding == "cdr"
                schema = self._schemas.get(record.schema_id, "") if is_cdr else ""
                if schema or not is_cdr:  # the schema of another may have been in a damaged chunk
                    self._channels[record.id] = (record.topic.strip("/"), schema)
            case records.Message():
                topic, schema = self._channels.get(record.channel_id, ("", ""))
                if topic:
                    self._add(topic, schema, record)
            case records.Metadata():
                self._log.metadata[record.name] = dict(record.metadata)

    def _add(self, topic: str, schema: str, record: Any) -> None:  # noqa: ANN401 - as mcap gives it
        payload = record.data
        if schema == STRING:
            schema = ""
            try:
                payload = text_of(payload)
            except ValueError as error:
                self._damaged[f"{topic}: {error}"] += 1
                return
        self._log.messages.append(LoggedMessage(topic, schema, record.log_time, payload, record.sequence))

    def _open_chunk(self, chunk: Any) -> None:  # noqa: ANN401 - as mcap gives it
        try:
            for record in self._unpacking.inside(chunk):
                self._take(record)
        except UnpackingError:
            raise
        except Exception as error:  # noqa: BLE001 - a parser that meets damage raises anything; counted and told
            self._damaged[str(error) or type(error).__name__] += 1
            if self._damaged.total() == 1:
                for known in types_at_end(self._file):
                    self._take(known)


def decode(message: LoggedMessage) -> Any:  # noqa: ANN401 - built at run time by the type store
    """Return a CDR message as an object with the fields of its type."""
    return _store(message.schema).deserialize_cdr(message.payload, message.schema)


def stamp_ns(decoded: Any) -> int:  # noqa: ANN401 - any message with a header
    """Return a header's stamp, ns since 1970."""
    stamp = decoded.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


@cache
def _store(schema: str) -> "Typestore":
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition(schema), schema))
    return store
