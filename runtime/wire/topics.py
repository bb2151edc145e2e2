"""Keys and payloads of the messages over zenoh. Shared with every client; knows no session and no task.

Telemetry, `wallride/<car>/<topic>`: standard ROS 2 messages in CDR, except

    status      one JSON object, the reason why the car is or is not moving
    decision    one JSON object per changed decision of the mux
    beat        the car's heartbeat for operators, binary (wallride.runtime.wire.teleop)

To the car: `operator/command`, binary; `param/list|get|set|save|configure|history|restart`,
`own_parts/show|forget`, queries in JSON.
Stamps in JSON are seconds on the car's monotonic clock. Missing numbers are null, never NaN (not JSON).
"""

import json
import re
from collections.abc import Mapping
from typing import Any

from pydantic_core import to_json

ROOT = "wallride"
CAR_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,31}")

SCAN = "scan"
ODOM = "odom"
NAVIGATION = "navigation"
SAFETY = "safety"
TELEOP = "teleop"
JOY = "joy"
OUTPUT = "output"
DISTANCE_ERROR = "distance_error"
WALL = "wall"
FOOTPRINT = "footprint"
IMU = "imu"
MOTOR = "motor"
BATTERY = "battery"
DIAGNOSTICS = "diagnostics"
TF = "tf"
POSE = "pose"
MAP = "map"
LINE = "line"
STATUS = "status"
DECISION = "decision"
BEAT = "beat"

BULK = frozenset({SCAN, WALL, FOOTPRINT})
"""Topics that a slow link loses first."""
LASTING = frozenset({MAP, LINE})
"""Topics whose one message holds until the car's end. It leaves behind all others, is recorded once in each file, and
is kept for late subscribers of ROS 2."""
JSON_TOPICS = (STATUS, DECISION)
"""Topics of telemetry in JSON; the others are ROS 2 messages (wallride.runtime.ros.definitions.TYPES)."""

COMMAND = "operator/command"
ALIVE = "alive"
PLAYED = "played"
"""Token beside `alive` of what is no car but a recording that is played under a car's name."""
REFUSED = "refused"
"""Token of a car whose name another one has at a router: `refused/SESSION`; the other one holds `alive/SESSION`."""
OPERATOR_ALIVE = "operator/alive"
PARAM = "param"
RECORD = "record"
"""Query that starts and stops recording on the car: no telemetry, although its key is one chunk deep."""
LOGS = "logs"
OWN_PARTS = "own_parts"
PLANNER = "planner"
"""Commands of the planner NAME come on `planner/NAME/command`."""
SIMULATOR = "simulator"
"""Query that changes the surroundings of a simulated car: answered only by a simulator, never by a car."""


def key(car: str, topic: str) -> str:
    """Return the key expression of one topic of one car."""
    return f"{ROOT}/{car}/{topic}"


def fits(name: str, pattern: str) -> bool:
    """Tell whether a key is the one name of a topic of one car that a pattern means.

    In a pattern `*` stands for one part, `**` at its end for any number. Who reaches the bus may put and announce any
    key, also one with wildcards, which reaches every pattern.
    """
    parts, depth = name.split("/"), pattern.count("/")
    return (
        (len(parts) >= depth if pattern.endswith("/**") else len(parts) == depth + 1)
        and len(parts) > 1
        and "*" not in name
        and name.isprintable()
        and CAR_NAME.fullmatch(parts[1]) is not None
    )


def planner_key(car: str, name: str) -> str:
    """Return the key of one planner's commands."""
    return key(car, f"{PLANNER}/{name}/command")


def encode(message: Mapping[str, Any]) -> bytes:
    """Encode a message; numbers that are not finite become null."""
    return to_json(message, inf_nan_mode="null")


def decode(payload: bytes) -> dict[str, Any]:
    """Decode a message; ValueError when it is not JSON, TypeError when it is not an object."""
    try:
        message = json.loads(payload)
    except RecursionError:
        raise ValueError("is nested too deeply") from None
    if not isinstance(message, dict):
        raise TypeError("not a JSON object")
    return message
