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
from wallride.runtime.recording.mcap_reading import Damage, FileFacts, LoggedRecord, McapReader
from wallride.runtime.recording.unpacking import UnpackingError
from wallride.runtime.ros.definitions import definition
from wallride.sim.recordings import RecordingError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

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
    try:
        _read(path, log, until)
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


def _read(path: Path, log: DriveLog, until: str | None) -> None:
    damaged: Counter[str] = Counter()
    for found in McapReader(path):
        match found:
            case LoggedRecord():
                if trouble := _add(log, found):
                    damaged[trouble] += 1
                elif until is not None and log.messages and log.messages[-1].topic == until:
                    break
            case FileFacts(name, values):
                log.metadata[name] = values
            case Damage(is_end=False):
                damaged[found.reason] += 1
            case Damage():
                saved = f"{len(log.messages)} messages were saved"
                log.notes.append(f"{log.name} ends in the middle ({found.reason}): {saved}.")
    if damaged:
        log.notes.append(f"{damaged.total()} damaged pieces are left out ({', '.join(damaged)}).")


def _add(log: DriveLog, found: LoggedRecord) -> str:
    """Add a message; return why it is damaged, "" where it is not."""
    topic, schema, record = found.topic.strip("/"), found.schema if found.encoding == "cdr" else "", found.record
    if found.encoding == "cdr" and not schema:  # it was in a damaged chunk
        return ""
    payload = record.data
    if schema == STRING:
        schema = ""
        try:
            payload = text_of(payload)
        except ValueError as error:
            return f"{topic}: {error}"
    log.messages.append(LoggedMessage(topic, schema, record.log_time, payload, record.sequence))
    return ""


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
