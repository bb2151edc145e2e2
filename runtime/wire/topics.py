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
from dataclasses import dataclass
from enum import Enum, auto
from types import MappingProxyType
from typing import Any, Final

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


class NewBy(Enum):
    """What makes a topic's value new. EACH: every message counts, and the hot path appends it itself."""

    SCAN = auto()
    GUIDANCE = auto()
    POSE = auto()
    MOTOR = auto()
    OUTPUT = auto()
    EACH = auto()


EVERY_ONE_S: Final = 0.0
ONCE_S: Final = 1e9
"""Recording period of what is recorded once, and again at the beginning of each file."""
_DRIVE = "ackermann_msgs/msg/AckermannDriveStamped"
_MARKERS = "visualization_msgs/msg/MarkerArray"


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic of telemetry.

    schema: its type of ROS 2, "" for a JSON object. meaning: of its value, for people, beginning with a noun.
    rate_hz: default of its setting, see `runtime/settings/telemetry.py`. recorded_s: recording period, None for what
    the decision log has anyway. number: field plotted by default, "" where it has no one number.
    """

    schema: str
    new_by: NewBy
    meaning: str
    rate_hz: float
    recorded_s: float | None
    number: str = ""


TELEMETRY: Final[Mapping[str, Topic]] = MappingProxyType(
    {
        SCAN: Topic(
            "sensor_msgs/msg/LaserScan", NewBy.SCAN,
            "the lidar's ranges, frame `laser`; a beam without a return is NaN (+Inf or -Inf on ROS 2's /scan)",
            rate_hz=20.0, recorded_s=None,
        ),
        ODOM: Topic(
            "nav_msgs/msg/Odometry", NewBy.MOTOR,
            "pose in `odom` and speed of the rear axle, by the wheels and a gyro, or without one the steering",
            rate_hz=20.0, recorded_s=0.05, number="twist.twist.linear.x",
        ),
        TF: Topic(
            "tf2_msgs/msg/TFMessage", NewBy.MOTOR,
            "the transforms `odom` to `base_link`, `base_link` to `laser`, and while it is known `map` to `odom`",
            rate_hz=20.0, recorded_s=0.05,
        ),
        POSE: Topic(
            "geometry_msgs/msg/PoseWithCovarianceStamped", NewBy.EACH,
            "pose of the rear axle in `map`, while the car is located on the map of `map.file`",
            rate_hz=20.0, recorded_s=EVERY_ONE_S, number="pose.pose.position.x",
        ),
        MAP: Topic(
            "nav_msgs/msg/OccupancyGrid", NewBy.POSE,
            "the map of `map.file`, frame `map`, of coarser cells where it is large; repeated, for new readers",
            rate_hz=0.2, recorded_s=ONCE_S,
        ),
        LINE: Topic(
            "nav_msgs/msg/Path", NewBy.POSE,
            "the map's race line, frame `map`: a pose's stamp is the line's own time there; repeated likewise",
            rate_hz=0.2, recorded_s=ONCE_S,
        ),
        MOTOR: Topic(
            "sensor_msgs/msg/JointState", NewBy.MOTOR,
            "joint `drive`: way, speed, motor current; joint `steering`: the commanded angle",
            rate_hz=20.0, recorded_s=0.05, number="velocity.0",
        ),
        IMU: Topic(
            "sensor_msgs/msg/Imu", NewBy.EACH,
            "the motor controller's angular rates and accelerations, in `base_link`",
            rate_hz=50.0, recorded_s=0.02, number="angular_velocity.z",
        ),
        BATTERY: Topic(
            "sensor_msgs/msg/BatteryState", NewBy.MOTOR, "voltage and input current of the motor controller",
            rate_hz=1.0, recorded_s=1.0, number="voltage",
        ),
        DISTANCE_ERROR: Topic(
            "std_msgs/msg/Float32", NewBy.EACH,
            "the follower's distance to its wall minus the wanted one [m]; NaN without a wall",
            rate_hz=200.0, recorded_s=EVERY_ONE_S, number="data",
        ),
        WALL: Topic(
            _MARKERS, NewBy.GUIDANCE, "markers: the fitted wall line and the path of the follower's ball",
            rate_hz=10.0, recorded_s=0.1,
        ),
        OUTPUT: Topic(
            _DRIVE, NewBy.EACH, "the drive command that was sent to the motor",
            rate_hz=200.0, recorded_s=EVERY_ONE_S, number="drive.speed",
        ),
        DECISION: Topic(
            "", NewBy.OUTPUT,
            "the mux's decision: source, reason, speed asked for and allowed; each change at once",
            rate_hz=10.0, recorded_s=0.1, number="allowed_mps",
        ),
        STATUS: Topic(
            "", NewBy.OUTPUT, "the state of the whole car; what `wallride status` shows",
            rate_hz=10.0, recorded_s=0.5, number="scan_to_motor_ms.p99",
        ),
        SAFETY: Topic(
            _DRIVE, NewBy.OUTPUT, "the driver's command with the speed that safety allows",
            rate_hz=20.0, recorded_s=0.05, number="drive.speed",
        ),
        NAVIGATION: Topic(
            _DRIVE, NewBy.OUTPUT, "the follower's drive command",
            rate_hz=20.0, recorded_s=0.05, number="drive.speed",
        ),
        TELEOP: Topic(
            _DRIVE, NewBy.OUTPUT, "the operator's drive command, while an operator drives",
            rate_hz=20.0, recorded_s=0.05, number="drive.speed",
        ),
        JOY: Topic(
            "sensor_msgs/msg/Joy", NewBy.OUTPUT,
            "what the operator holds, as the pad of an Xbox (`runtime/telemetry/pad.py`), while one is there",
            rate_hz=20.0, recorded_s=0.05,
        ),
        FOOTPRINT: Topic(
            _MARKERS, NewBy.OUTPUT, "markers: the outline, the swept path, and what stops the car",
            rate_hz=10.0, recorded_s=0.1,
        ),
        DIAGNOSTICS: Topic(
            "diagnostic_msgs/msg/DiagnosticArray", NewBy.OUTPUT, "health of lidar, motor, window and mux for ROS tools",
            rate_hz=1.0, recorded_s=1.0,
        ),
    }
)  # fmt: skip
"""Every topic, in the order of its event's messages; types, rates, recording periods and documents follow."""

BULK = frozenset({SCAN, WALL, FOOTPRINT})
"""Topics that a slow link loses first."""
LASTING = frozenset(name for name, topic in TELEMETRY.items() if topic.recorded_s == ONCE_S)
"""Topics whose one message holds until the car's end. It leaves behind all others, is recorded once in each file, and
is kept for late subscribers of ROS 2."""
JSON_TOPICS = tuple(name for name, topic in TELEMETRY.items() if not topic.schema)
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


def new_by(event: NewBy) -> tuple[str, ...]:
    """Return the topics that an event makes new."""
    return tuple(name for name, topic in TELEMETRY.items() if topic.new_by is event)


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
