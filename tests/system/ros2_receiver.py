"""A ROS 2 program without wallride: zenoh-ros2-sdk finds a car's topics, subscribes to each and decodes it.

    python ros2_receiver.py ENDPOINT DOMAIN SECONDS

Prints one JSON object: the topics by name, each with type, hash, quality of service and its first messages. The
definitions come from rosbags, the hashes are computed by the SDK, and every key is built by it.
"""

import json
import os
import sys
import time
from typing import Any

ENDPOINT, DOMAIN, SECONDS = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
os.environ["ZENOH_CONFIG_OVERRIDE"] = f'mode="client";connect/endpoints=["{ENDPOINT}"];listen/endpoints=[]'

import numpy as np  # noqa: E402
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402
from zenoh_ros2_sdk import ROS2Subscriber  # noqa: E402
from zenoh_ros2_sdk.attachment import Attachment  # noqa: E402
from zenoh_ros2_sdk.discovery import get_topic_info, get_topic_names_and_types  # noqa: E402
from zenoh_ros2_sdk.session import ZenohSession  # noqa: E402
from zenoh_ros2_sdk.utils import get_type_hash  # noqa: E402

ACKERMANN = "ackermann_msgs/msg/AckermannDrive"
STORE = get_typestore(Stores.ROS2_JAZZY)
STORE.register(
    {
        **get_types_from_msg(
            "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\n"
            "float32 acceleration\nfloat32 jerk\n",
            ACKERMANN,
        ),
        **get_types_from_msg(
            "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n", f"{ACKERMANN}Stamped"
        ),
    }
)  # fmt: skip
SHOWN_OF_ARRAY = 4


def definitions(schema):
    """Return the whole text of a type, and its own fields and those of its parts, by name."""
    whole, _ = STORE.generate_msgdef(schema, ros_version=2)
    first, *others = whole.split("=" * 80 + "\n")
    parts = {}
    for other in others:
        head, _, fields = other.partition("\n")
        package, name = head.removeprefix("MSG: ").split("/")[:: 2 if head.count("/") > 1 else 1]
        parts[f"{package}/msg/{name}"] = fields
    return whole, first, parts


def plain(value):
    """Return a message as JSON values, arrays cut to their first numbers."""
    if isinstance(value, np.ndarray):
        return {"size": int(value.size), "first": [float(one) for one in value[:SHOWN_OF_ARRAY]]}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if hasattr(value, "__msgtype__"):
        return {name: plain(one) for name, one in vars(value).items() if name != "__msgtype__"}
    return value


def subscribe(topic, schema, found):
    """Subscribe to a topic by the SDK's own key; collect its messages and attachments."""
    whole, own, parts = definitions(schema)
    type_hash = get_type_hash(schema, own, parts)
    (publisher,) = get_topic_info(topic, domain_id=DOMAIN, verbose=True).publishers
    found.update(
        schema=schema, computed=type_hash, announced=publisher.type_hash, qos=publisher.qos, node=publisher.node_name
    )
    subscriber = ROS2Subscriber(
        topic, schema, lambda message: found["messages"].append(plain(message)), msg_definition=whole,
        domain_id=DOMAIN, type_hash=type_hash, qos=publisher.qos,
    )  # fmt: skip
    session = ZenohSession.get_instance().session

    def note(sample):
        read = Attachment.from_bytes(sample.attachment.to_bytes())
        found["attachments"].append([len(sample.attachment), read.sequence_id, read.timestamp_ns, read.gid.hex()])

    return subscriber, session.declare_subscriber(subscriber.keyexpr, note)


def main():
    until_s = time.monotonic() + SECONDS
    names = []
    while not names and time.monotonic() < until_s:
        names = get_topic_names_and_types(domain_id=DOMAIN)
    found: dict[str, dict[str, Any]] = {name: {"messages": [], "attachments": []} for name, _ in names}
    held = [subscribe(name, schemas[0], found[name]) for name, schemas in names]
    while time.monotonic() < until_s and any(len(each["messages"]) < 1 for each in found.values()):
        time.sleep(0.1)
    time.sleep(1.0)
    for subscriber, _ in held:
        subscriber.close()
    for each in found.values():
        each.update(count=len(each["messages"]), messages=each["messages"][:2], attachments=each["attachments"][:3])
    sys.stdout.write(json.dumps(found))
    sys.stdout.flush()
    os._exit(0)  # the SDK keeps its session


main()
