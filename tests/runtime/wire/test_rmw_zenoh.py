"""Keys, hashes, tokens and attachments are those of rmw_zenoh, judged by rosbags and by keys that were seen to work."""

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wallride.runtime.ros.definitions import TYPES, definition
from wallride.runtime.ros.graph import PUBLISHED, TF_STATIC, access
from wallride.runtime.wire import topics
from wallride.runtime.wire.rmw_zenoh import (
    ATTACHMENT,
    TYPE_HASHES,
    Distro,
    RosGraph,
    RosTopic,
    attachment,
    gid,
    node_name,
    read_attachment,
)

GRAPH = RosGraph(0, Distro.JAZZY, "wallride_car1")
SCAN = RosTopic("scan", "sensor_msgs/msg/LaserScan")
RECENT = (Stores.ROS2_IRON, Stores.ROS2_JAZZY, Stores.ROS2_KILTED, Stores.ROS2_LYRICAL)


@pytest.mark.parametrize("schema", sorted(set(TYPES.values())))
def test_a_hash_is_what_rosbags_computes_from_our_definition_and_from_ros_own(schema):
    ours = get_typestore(Stores.EMPTY)
    ours.register(get_types_from_msg(definition(schema), schema))
    stores = [ours, *(get_typestore(one) for one in RECENT if not schema.startswith("ackermann"))]
    assert {store.hash_rihs01(schema) for store in stores} == {f"RIHS01_{TYPE_HASHES[schema]}"}


def test_every_type_has_a_hash_and_no_hash_is_left_over():
    assert set(TYPE_HASHES) == set(TYPES.values())


def test_the_keys_are_those_that_a_ros_2_program_subscribes_to():
    assert GRAPH.data_key(SCAN) == (
        "0/scan/sensor_msgs::msg::dds_::LaserScan_/"
        "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"
    )
    humble = RosGraph(7, Distro.HUMBLE, "wallride_car1")
    assert humble.data_key(SCAN) == "7/scan/sensor_msgs::msg::dds_::LaserScan_/TypeHashNotSupported"


def test_the_tokens_have_the_parts_that_ros_2_reads():
    assert GRAPH.node_token("ab12") == "@ros2_lv/0/ab12/0/0/NN/%/%/wallride_car1"
    token = GRAPH.endpoint_token("ab12", 3, "MP", TF_STATIC)
    parts = token.split("/")
    assert parts[:10] == ["@ros2_lv", "0", "ab12", "0", "3", "MP", "%", "%", "wallride_car1", "%tf_static"]
    assert parts[10:] == [
        "tf2_msgs::msg::dds_::TFMessage_", f"RIHS01_{TYPE_HASHES['tf2_msgs/msg/TFMessage']}", ":1:,1:,:,:,,",
    ]  # fmt: skip


def test_each_publisher_has_a_gid_of_its_own_that_stays():
    tokens = [GRAPH.endpoint_token("ab12", number, "MP", topic) for number, topic in enumerate(PUBLISHED.values())]
    assert len({gid(token) for token in tokens}) == len(tokens)
    assert {len(gid(token)) for token in tokens} == {16}
    assert gid("").hex() == "7f498d4624c30160d8984701d306aa99", "XXH3-128 of nothing, its low half first"


def test_an_attachment_has_exactly_33_bytes_and_reads_back():
    publisher = bytes(range(16))
    data = attachment(7, 1_790_000_000_123_456_789, publisher)
    assert len(data) == ATTACHMENT.size == 33
    assert data[16] == 16
    assert read_attachment(data) == (7, 1_790_000_000_123_456_789, publisher)


@pytest.mark.parametrize(
    "data", [b"", bytes(32), bytes(34), bytes(33), attachment(1, 1, bytes(16))[:16] + b"\x0f" + bytes(16)]
)
def test_an_attachment_of_another_form_is_refused(data):
    with pytest.raises(ValueError, match="bytes instead of"):
        read_attachment(data)


@pytest.mark.parametrize(("car", "node"), [("car1", "wallride_car1"), ("8-a_b", "wallride_8_a_b")])
def test_a_node_has_a_name_that_ros_2_allows(car, node):
    assert node_name(car) == node


def test_the_access_control_gets_every_key_that_is_published():
    keys = access(GRAPH)
    assert set(keys.published) == {GRAPH.data_key(topic) for topic in (*PUBLISHED.values(), TF_STATIC)}
    latched = (*(PUBLISHED[topic] for topic in topics.LASTING), TF_STATIC)
    assert set(keys.latched) == {GRAPH.data_key(topic) for topic in latched}
