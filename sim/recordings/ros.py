"""Reader of ROS recordings without ROS: .bag of ROS 1, .db3 and .mcap of ROS 2, or a ROS 2 recording's folder.

The package `rosbags` is imported only when such a file is opened, so that .npz archives play without it.
"""

import re
import resource
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from wallride.runtime.recording.mcap_file import METADATA
from wallride.runtime.recording.mcap_reading import Damage, FileFacts, LoggedRecord, McapReader
from wallride.runtime.recording.unpacking import Unpacking, UnpackingError, bomb, most_bytes
from wallride.sim.recordings.messages import ACKERMANN_DEFINITIONS, WANTED_TYPES, Collector
from wallride.sim.recordings.recording import RecordingError
from wallride.sim.recordings.salvage import RawMessage, whole_messages
from wallride.sim.recordings.tracks import Tracks

if TYPE_CHECKING:
    from rosbags.typesys import Stores
    from rosbags.typesys.store import Typestore

ROS1: Final = "ros1"
CDR: Final = "cdr"
Decode = Callable[[bytes, str], Any]
PYTHONS = (AttributeError, IndexError, KeyError, TypeError)
"""Errors of a parser that damage leads astray: their texts are about its code, not about the file."""


def collect_mcap(path: Path, collector: Collector, decoders: dict[str, Decode]) -> str:
    """Collect all that can be read; return why it ends before its end or lacks a piece, "" when it does not.

    decoders: by the encoding of messages. RecordingError when it unpacks to more than its size explains.
    """
    damaged = ""
    try:
        for found in McapReader(path):
            match found:
                case LoggedRecord():
                    _take(found, collector, decoders)
                case FileFacts(name=name):
                    collector.is_ours |= name == METADATA
                case Damage():
                    damaged = found.reason
    except UnpackingError as error:
        raise RecordingError(f"{path}: {error}.") from None
    return damaged


def _take(found: LoggedRecord, collector: Collector, decoders: dict[str, Decode]) -> None:
    topic, kind, encoding = found.topic, _ros2_type(found.schema), found.encoding
    if kind not in WANTED_TYPES:
        return
    if encoding not in decoders:
        collector.unreadable[topic] += 1
        collector.encodings[topic] = encoding
        return
    _decode([(topic, kind, found.record.log_time, found.record.data)], decoders[encoding], collector)


def _ros2_type(name: str) -> str:
    package, _, kind = name.partition("/")
    return name if "/" in kind else f"{package}/msg/{kind}"


def read_ros(path: Path) -> Tracks:
    """Return all tracks of a ROS recording; of a damaged one the recoverable part, with a note of its size.

    path: a file, or a folder with or without its metadata.yaml.

    Raises:
        RecordingError: nothing can be read, it unpacks to more than its size explains, or `rosbags` is not installed.
    """
    try:
        with bounded_memory(path):
            return _tracks(path)
    except ModuleNotFoundError as error:
        raise RecordingError(
            f"{path} needs the package {error.name}: install wallride with its extra [sim]."
        ) from error


def _tracks(path: Path) -> Tracks:
    is_lone = path.is_dir() and not (path / "metadata.yaml").is_file()
    collector, cut_short = _read_pieces(path) if is_lone else _read(path)
    if cut_short and not collector.scans:
        raise RecordingError(f"{path} cannot be read ({cut_short}) and no scan could be saved: fetch it again.")
    tracks = collector.tracks()
    if cut_short:
        tracks.notes.insert(
            0, f"{path.name} cannot be read in order ({cut_short}): {collector.scans} scans were saved."
        )
    if is_lone:
        tracks.notes.insert(0, f"{path.name} lacks its metadata.yaml: its files are read in the order of their names.")
    return tracks


def _pieces(folder: Path) -> list[Path]:
    """Return the files of a recording's folder: r_2 before r_10."""
    files = [*folder.glob("*.db3"), *folder.glob("*.mcap")]
    return sorted(
        files, key=lambda file: [int(part) if part.isdigit() else 0 for part in re.split(r"(\d+)", file.name)]
    )


def _read_pieces(folder: Path) -> tuple[Collector, str]:
    collector, reasons = Collector(), []
    for file in _pieces(folder):
        found, reason = _read(file)
        collector.extend(found)
        if reason:
            reasons.append(f"{file.name}: {reason}")
    return collector, "; ".join(reasons)


def _read(path: Path) -> tuple[Collector, str]:
    """Return what can be read, and why that is not all, "" when it is."""
    collector = Collector()
    reason = _collect(path, collector)
    if reason:
        collector = max(collector, _salvaged(path), key=lambda found: found.scans)
    return collector, reason


def _collect(path: Path, collector: Collector) -> str:
    """Collect all messages up to the first damage; return what it is, "" without one."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores

    if path.suffix == ".mcap" and path.is_file():
        return collect_mcap(path, collector, _decoders())
    check_tables(path)
    most_messages = Unpacking(path.stat().st_size)
    try:
        with AnyReader([path], default_typestore=_with_ackermann(Stores.ROS2_HUMBLE)) as reader:
            # an empty list would mean "all topics" to rosbags
            if wanted := [connection for connection in reader.connections if connection.msgtype in WANTED_TYPES]:
                for connection, received_ns, raw in reader.messages(wanted):
                    most_messages.count()
                    message = reader.deserialize(raw, connection.msgtype)
                    collector.add(connection.topic, connection.msgtype, received_ns, message)
    except MemoryError:
        raise
    except UnpackingError as error:
        raise RecordingError(f"{path}: {error}.") from None
    except Exception as error:  # noqa: BLE001 - a parser that meets damage raises anything; the caller reports it
        words = "" if isinstance(error, PYTHONS) else _sentence(error).rstrip(".")
        return words or "its records contradict each other"
    return ""


def _sentence(error: BaseException) -> str:
    """Return an error's text, without the quotes and commas of a tuple that a library put into it."""
    return re.sub(r"\('([^']*)',\)", r"\1", str(error))


def _salvaged(path: Path) -> Collector:
    """Read past the damage: ROS 1 records are searched, a .db3 is read without its index, a folder file by file."""
    if path.is_dir():
        return _read_pieces(path)[0]
    collector, decoders = Collector(), _decoders()
    if path.suffix == ".db3":
        _decode(rows_before_damage(path), decoders[CDR], collector)
    elif path.suffix == ".bag":
        _decode(whole_messages(path.read_bytes()), decoders[ROS1], collector)
    return collector


def _decode(messages: Iterable[RawMessage], decode: Decode, collector: Collector) -> None:
    for topic, message_type, received_ns, raw in messages:
        if message_type not in WANTED_TYPES:
            continue
        try:
            message = decode(raw, message_type)
        except MemoryError:
            raise
        except Exception:  # noqa: BLE001 - a parser that meets damage raises anything; counted and told to the user
            collector.unreadable[topic] += 1
        else:
            collector.add(topic, message_type, received_ns, message)


def _decoders() -> dict[str, Decode]:
    from rosbags.typesys import Stores

    return {
        CDR: _with_ackermann(Stores.ROS2_HUMBLE).deserialize_cdr,
        ROS1: _with_ackermann(Stores.ROS1_NOETIC).deserialize_ros1,
    }


def _with_ackermann(store: "Stores") -> "Typestore":
    from rosbags.typesys import get_types_from_msg, get_typestore

    typestore = get_typestore(store)
    for name, definition in ACKERMANN_DEFINITIONS.items():
        typestore.register(get_types_from_msg(definition, name))
    return typestore


@contextmanager
def bounded_memory(path: Path) -> Iterator[None]:
    """Let this process have as much more memory as a recording of that size can need; RecordingError beyond it."""
    files = [*path.glob("*")] if path.is_dir() else [path]
    size_bytes = sum(file.stat().st_size for file in files if file.is_file())
    before, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = _taken_bytes() + size_bytes + 2 * most_bytes(size_bytes)  # messages, and the arrays made of them
    resource.setrlimit(resource.RLIMIT_AS, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
    try:
        yield
    except MemoryError:
        raise RecordingError(f"{path}: {bomb(size_bytes)}.") from None
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (before, hard))


def _taken_bytes() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()


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
