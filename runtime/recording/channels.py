"""The channels of a recording: ROS 2 messages, all of them, as the MCAP profile "ros2" demands.

wallride's text topics (JSON, TOML) are std_msgs/msg/String: with a single JSON channel in the file `mcap-ros2-support`
and `ros2 bag play` refuse the whole file.
"""

import struct
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from wallride.runtime.ros.cdr import ENCAPSULATION
from wallride.runtime.ros.definitions import definition

STRING = "std_msgs/msg/String"
BYTES = "std_msgs/msg/UInt8MultiArray"

TAPE = "tape"
SETTINGS = "settings"
LOG = "log"
EVENTS = "events"
RAW = "raw"

_SEPARATOR = "=" * 80
_OWN_DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {
        STRING: "string data\n",
        BYTES: f"""std_msgs/MultiArrayLayout layout
uint8[] data
{_SEPARATOR}
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
{_SEPARATOR}
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
""",
    }
)
_LENGTH = struct.Struct("<I")
_LAYOUT_AND_LENGTH = struct.Struct("<III")
_HEAD_B = len(ENCAPSULATION) + _LENGTH.size


class RecordMessage(NamedTuple):
    """One message to be recorded.

    stamp_ns: since 1970, by the wall clock as it stood when the process began. sequence: the scan's, 0 elsewhere.
    lasting: it holds until the next one of its topic, so that a file needs the last one before its beginning, too.
    """

    topic: str
    schema: str
    stamp_ns: int
    payload: bytes | memoryview
    sequence: int = 0
    lasting: bool = False


def schema_text(schema: str) -> str:
    """Return the definition of a message type; KeyError for one that wallride does not record."""
    return _OWN_DEFINITIONS.get(schema) or definition(schema)


def text(payload: bytes) -> bytes:
    """Return std_msgs/String for a text in UTF-8."""
    return b"".join((ENCAPSULATION, _LENGTH.pack(len(payload) + 1), payload, b"\0"))


def text_of(message: bytes) -> bytes:
    """Return the text in a std_msgs/String; ValueError when it is none."""
    if len(message) < _HEAD_B:
        raise ValueError("too short for a text")
    (length,) = _LENGTH.unpack_from(message, len(ENCAPSULATION))
    if length < 1 or _HEAD_B + length > len(message):
        raise ValueError("a text of another length than it says")
    return message[_HEAD_B : _HEAD_B + length - 1]


def octets(payload: bytes) -> bytes:
    """Return std_msgs/UInt8MultiArray for raw bytes, without dimensions."""
    return b"".join((ENCAPSULATION, _LAYOUT_AND_LENGTH.pack(0, 0, len(payload)), payload))
