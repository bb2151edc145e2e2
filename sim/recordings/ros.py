"""Reader of ROS recordings without ROS: .bag of ROS 1, .db3 and .mcap of ROS 2, or a ROS 2 recording's folder.

The package `rosbags` is imported only when such a file is opened, so that .npz archives play without it.
"""

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from sim.recordings.messages import ACKERMANN_DEFINITIONS, WANTED_TYPES, Collector
from sim.recordings.recording import RecordingError
from sim.recordings.salvage import RawMessage, whole_messages
from sim.recordings.salvage_ros2 import repaired_mcap, rows_before_damage
from sim.recordings.tracks import Tracks

if TYPE_CHECKING:
    from rosbags.typesys import Stores
    from rosbags.typesys.store import Typestore


def read_ros(path: Path) -> Tracks:
    """Return all tracks of a ROS recording; of a damaged one the recoverable part, with a note of its size.

    Raises:
        RecordingError: nothing can be read, or `rosbags` is not installed.
    """
    try:
        tracks = _read_orderly(path)
    except ModuleNotFoundError as error:
        raise RecordingError(
            f"{path} needs the package {error.name}: install wallride with its extra [sim]."
        ) from error
    if not tracks.cut_short:
        return tracks
    saved = max(tracks, _salvaged(path), key=lambda found: found.scans)
    if not saved.scans:
        raise RecordingError(f"{path} cannot be read ({tracks.cut_short}) and no scan could be saved: fetch it again.")
    saved.notes.insert(0, f"{path.name} cannot be read in order ({tracks.cut_short}): {saved.scans} scans were saved.")
    return saved


def _read_orderly(path: Path) -> Tracks:
    """Read by the file's own index, up to the first damage."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores

    collector = Collector()
    cut_short = ""
    try:
        with AnyReader([path], default_typestore=_with_ackermann(Stores.ROS2_HUMBLE)) as reader:
            # an empty list would mean "all topics" to rosbags
            if wanted := [connection for connection in reader.connections if connection.msgtype in WANTED_TYPES]:
                for connection, received_ns, raw in reader.messages(wanted):
                    message = reader.deserialize(raw, connection.msgtype)
                    collector.add(connection.topic, connection.msgtype, received_ns, message)
    except Exception as error:  # noqa: BLE001 - a parser that meets damage raises anything; the caller reports it
        cut_short = _sentence(error).rstrip(".") or "its records contradict each other"
    tracks = collector.tracks()
    tracks.cut_short = cut_short
    return tracks


def _sentence(error: BaseException) -> str:
    """Return an error's text, without the quotes and commas of a tuple that a library put into it."""
    return re.sub(r"\('([^']*)',\)", r"\1", str(error))


def _salvaged(path: Path) -> Tracks:
    """Read past the damage: ROS 1 records are searched, an MCAP is closed, a .db3 read without index."""
    from rosbags.typesys import Stores

    if path.is_dir():
        files = [*path.glob("*.db3"), *path.glob("*.mcap")]
        return _salvaged(files[0]) if len(files) == 1 else Tracks()
    if path.suffix == ".mcap":
        with repaired_mcap(path) as repaired:
            return _read_orderly(repaired)
    if path.suffix == ".db3":
        return _decoded(rows_before_damage(path), _with_ackermann(Stores.ROS2_HUMBLE).deserialize_cdr)
    if path.suffix == ".bag":
        return _decoded(whole_messages(path.read_bytes()), _with_ackermann(Stores.ROS1_NOETIC).deserialize_ros1)
    return Tracks()


def _decoded(messages: Iterable[RawMessage], decode: Callable[[bytes, str], object]) -> Tracks:
    collector = Collector()
    for topic, message_type, received_ns, raw in messages:
        if message_type not in WANTED_TYPES:
            continue
        try:
            message = decode(raw, message_type)
        except Exception:  # noqa: BLE001 - a parser that meets damage raises anything; counted and told to the user
            collector.unreadable[topic] += 1
        else:
            collector.add(topic, message_type, received_ns, message)
    return collector.tracks()


def _with_ackermann(store: "Stores") -> "Typestore":
    from rosbags.typesys import get_types_from_msg, get_typestore

    typestore = get_typestore(store)
    for name, definition in ACKERMANN_DEFINITIONS.items():
        typestore.register(get_types_from_msg(definition, name))
    return typestore
