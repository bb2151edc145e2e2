"""Keys, tokens and attachments by which rmw_zenoh, the ROS 2 middleware over zenoh, finds topics. Pure text and bytes.

    data      <domain>/<topic>/<type>/<hash of the type>
    node      @ros2_lv/<domain>/<session>/0/0/NN/%/%/<node>
    endpoint  @ros2_lv/<domain>/<session>/0/<number>/<MP or MS>/%/%/<node>/%<topic>/<type>/<hash>/<quality of service>

MP is a publisher, MS a subscription; % stands for an empty enclave or namespace, and for / in a name. A sample carries
an attachment of exactly 33 bytes: a ROS 2 process that cannot parse one aborts, so none is sent without it.
Source: ros2/rmw_zenoh, design.md and liveliness_utils.cpp.
"""

import re
import struct
from enum import StrEnum
from types import MappingProxyType
from typing import Final, Literal

from wallride.drivers.value import value

GRAPH: Final = "@ros2_lv"
LATCHED_SUFFIX: Final = "@adv/**"
"""Below a latched topic's key: the cache of its publisher, from which late subscribers get the last message."""
GID_BYTES: Final = 16
ATTACHMENT: Final = struct.Struct("<qqB16s")
MAX_DOMAIN: Final = 232
ROS2_PLANNER: Final = "ros2"
"""Name of the planner behind /drive: also that of the certificate which may publish there."""
MAX_DRIVE_B: Final = 160
"""Maximum size of a drive command with its attachment: 40 and 33 bytes, and the name of its frame."""
BEST_EFFORT: Final = "2::,5:,:,:,,"
"""Quality of service of data: newest five, may be lost."""
LATCHED: Final = ":1:,1:,:,:,,"
"""Reliable, and kept for late subscribers (transient local), as of /tf_static."""
NO_HASH: Final = "TypeHashNotSupported"
"""In place of the hash on Humble."""

TYPE_HASHES: Final = MappingProxyType(
    {
        "ackermann_msgs/msg/AckermannDriveStamped": "48ca7612a08d3bb72744fd98b71b7cf2ea24c6ad50fa4e1aa0bbad963c90d8cf",
        "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
        "geometry_msgs/msg/PoseWithCovarianceStamped": "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",  # noqa: E501
        "nav_msgs/msg/OccupancyGrid": "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7",
        "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
        "nav_msgs/msg/Path": "1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b",
        "sensor_msgs/msg/BatteryState": "4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741",
        "sensor_msgs/msg/Imu": "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
        "sensor_msgs/msg/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
        "sensor_msgs/msg/Joy": "0d356c79cad3401e35ffeb75a96a96e08be3ef896b8b83841d73e890989372c5",
        "sensor_msgs/msg/LaserScan": "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
        "std_msgs/msg/Float32": "7170d3d8f841f7be3172ce5f4f59f3a4d7f63b0447e8b33327601ad64d83d6e2",
        "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
        "visualization_msgs/msg/MarkerArray": "86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf",
    }
)
"""RIHS01 hash of each type in runtime/ros/types.msg, the same from Iron to Lyrical."""


class Distro(StrEnum):
    """ROS 2 distributions; Humble and later ones do not understand each other over rmw_zenoh."""

    HUMBLE = "humble"
    IRON = "iron"
    JAZZY = "jazzy"
    KILTED = "kilted"
    LYRICAL = "lyrical"
    ROLLING = "rolling"


@value()
class RosTopic:
    """One topic as ROS 2 knows it. name: without a slash in front. schema: such as sensor_msgs/msg/LaserScan."""

    name: str
    schema: str
    qos: str = BEST_EFFORT


@value()
class RosGraph:
    """A ROS 2 domain, and the car's node in it."""

    domain: int
    distro: Distro
    node: str

    def data_key(self, topic: RosTopic) -> str:
        """Return the key of a topic's samples."""
        return f"{self.domain}/{topic.name}/{_dds_type(topic.schema)}/{self.type_hash(topic.schema)}"

    def any_type_key(self, topic: RosTopic) -> str:
        """Return the keys of a topic's samples of whatever type, this one's among them."""
        return f"{self.domain}/{topic.name}/*/*"

    def type_hash(self, schema: str) -> str:
        """Return the hash of a type in keys; KeyError for a type that wallride does not use."""
        return NO_HASH if self.distro is Distro.HUMBLE else f"RIHS01_{TYPE_HASHES[schema]}"

    def node_token(self, session: str) -> str:
        """Return the node's liveliness token; session: zenoh's id of it."""
        return f"{GRAPH}/{self.domain}/{session}/0/0/NN/%/%/{self.node}"

    def endpoint_token(self, session: str, number: int, kind: Literal["MP", "MS"], topic: RosTopic) -> str:
        """Return the liveliness token of a publisher or a subscription. number: unique in the node, not 0."""
        mangled = "%" + topic.name.replace("/", "%")
        kinds = f"{_dds_type(topic.schema)}/{self.type_hash(topic.schema)}/{topic.qos}"
        return f"{GRAPH}/{self.domain}/{session}/0/{number}/{kind}/%/%/{self.node}/{mangled}/{kinds}"


@value()
class RosAccess:
    """Keys that the session's access control has to let through. drive: of the commands, "" where none are taken.

    scans: the lidar's scans come by the bus, from a program on this machine; no certificate has a right to send them.
    """

    domain: int
    published: tuple[str, ...]
    latched: tuple[str, ...]
    drive: str = ""
    scans: bool = False


def node_name(car: str) -> str:
    """Return the name of a car's node: letters, digits and _, as ROS 2 demands."""
    return "wallride_" + re.sub(r"\W", "_", car)


def gid(token: str) -> bytes:
    """Return the 16 bytes by which ROS 2 tells publishers apart: as rmw_zenoh_cpp derives them from the token."""
    import xxhash  # here: only the ROS 2 face needs it

    return xxhash.xxh3_128_intdigest(token.encode()).to_bytes(GID_BYTES, "little")


def attachment(sequence: int, stamp_ns: int, publisher: bytes) -> bytes:
    """Return a sample's attachment. stamp_ns: nanoseconds since 1970. publisher: its gid."""
    return ATTACHMENT.pack(sequence, stamp_ns, GID_BYTES, publisher)


def read_attachment(data: bytes) -> tuple[int, int, bytes]:
    """Return sequence number, nanoseconds since 1970 and gid; ValueError for another form."""
    if len(data) != ATTACHMENT.size:
        raise ValueError(f"an attachment of {len(data)} bytes instead of {ATTACHMENT.size}")
    sequence, stamp_ns, gid_bytes, publisher = ATTACHMENT.unpack(data)
    if gid_bytes != GID_BYTES:
        raise ValueError(f"a gid of {gid_bytes} bytes instead of {GID_BYTES}")
    return sequence, stamp_ns, publisher


def _dds_type(schema: str) -> str:
    package, kind, name = schema.split("/")
    return f"{package}::{kind}::dds_::{name}_"
