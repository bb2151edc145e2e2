"""A ROS 2 program that is not ours finds and decodes every topic of a running car, and no viewer can add to them."""

import asyncio
import json
import sys
from pathlib import Path

import pytest
import zenoh
from zenoh import ext

from tests.system.operated import operated
from tests.system.test_attacks import PEOPLE, keys, tls  # noqa: F401 - keys is a fixture
from wallride.runtime.ros.graph import PUBLISHED, SCAN_BY_BEAM, TF_ODOM, TF_STATIC, access
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.car_bus import CarBus
from wallride.runtime.wire.network import CDR
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.rmw_zenoh import GRAPH as TOKENS
from wallride.runtime.wire.rmw_zenoh import Distro, RosGraph, attachment
from wallride.runtime.wire.zenoh_config import car_config, client_config

pytestmark = pytest.mark.timeout(90)
RECEIVER = Path(__file__).with_name("ros2_receiver.py")
DOMAIN = 7
AT_REST_G = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *(0.0,) * 10)
"""What a sensor in the motor controller answers: rad, g, deg/s ..."""
GRAPH = RosGraph(DOMAIN, Distro.JAZZY, "wallride_car1")
SCAN_KEY, STATIC_KEY = GRAPH.data_key(PUBLISHED[SCAN_BY_BEAM]), GRAPH.data_key(TF_STATIC)
NOTE = attachment(1, 1, bytes(16))


async def receive(endpoint):
    process = await asyncio.create_subprocess_exec(
        sys.executable, str(RECEIVER), endpoint, str(DOMAIN), "20",
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    output, errors = await process.communicate()
    assert process.returncode == 0, errors.decode()
    return json.loads(output)


async def test_an_independent_receiver_finds_and_decodes_every_topic_of_the_driving_car(tmp_path):
    async with operated(tmp_path, "ros2.enabled=true", f"ros2.domain={DOMAIN}") as scene:
        scene.car.vesc.imu = AT_REST_G
        await scene.car.until_driving()
        await scene.drive_by_hand()
        found = await receive(scene.entrance)
    names = {f"/{topic.name}": topic for topic in (*PUBLISHED.values(), TF_STATIC)}
    assert set(found) == set(names)
    for name, each in found.items():
        assert each["schema"] == names[name].schema
        assert each["computed"] == each["announced"], "the SDK's hash of ROS's own definition"
        assert (each["qos"], each["node"]) == (names[name].qos, "wallride_sim")
        if name == "/pose":  # there is no map
            continue
        assert each["count"] >= 1, f"nothing came on {name}"
        if name != "/tf_static":  # the SDK asks for what is kept, and shows no attachment of it
            assert_attachments(each)
    assert_contents({name: each["messages"][0] for name, each in found.items() if name != "/pose"})


def assert_attachments(each):
    sizes, sequences, stamps_ns, gids = zip(*each["attachments"], strict=True)
    assert set(sizes) == {33}
    assert list(sequences) == sorted(set(sequences))
    assert len(set(gids)) == 1
    first = each["messages"][0]
    if stamp := first.get("header", {}).get("stamp"):
        sweep_s = first["time_increment"] * (first["ranges"]["size"] - 1) if "ranges" in first else 0.0
        assert sweep_s == pytest.approx(0.01875 if "ranges" in first else 0.0), "of 270 degrees at 40 Hz"
        header_ns = stamp["sec"] * 10**9 + stamp["nanosec"]
        assert stamps_ns[0] - header_ns == pytest.approx(1e9 * sweep_s, abs=5000)


def assert_contents(first):
    """The frames are those of REP-105, and the numbers are the car's."""
    scan = first["/scan"]
    assert (scan["header"]["frame_id"], scan["ranges"]["size"]) == ("laser", 1081)
    assert (first["/odom"]["header"]["frame_id"], first["/odom"]["child_frame_id"]) == ("odom", "base_link")
    assert frames(first["/tf"]) == [("odom", "base_link")]
    assert frames(first["/tf_static"]) == [("base_link", "laser")]
    assert first["/imu"]["header"]["frame_id"] == "base_link"
    assert first["/imu"]["linear_acceleration"]["z"] == pytest.approx(9.81, abs=0.02)
    assert first["/battery"]["voltage"] == pytest.approx(11.8, abs=0.05)
    assert first["/teleop"]["drive"]["speed"] == pytest.approx(2.0, abs=0.05)
    assert {status["name"] for status in first["/diagnostics"]["status"]} == {"lidar", "motor", "window", "mux"}
    assert first["/footprint"]["markers"][0]["header"]["frame_id"] == "base_link"


def frames(message):
    return [(one["header"]["frame_id"], one["child_frame_id"]) for one in message["transforms"]]


@pytest.fixture
async def guarded(keys):  # noqa: F811 - the fixture
    """A car with certificates and ROS 2 keys, a ROS 2 program of a viewer, and what reached the car."""
    endpoint = free_endpoint().replace("tcp/", "tls/")
    car = CarBus(car_config([endpoint], tls(keys, "car"), PEOPLE, "car1", access(GRAPH)))
    reached = []
    for key in (f"{DOMAIN}/**", f"{TOKENS}/**"):
        car.subscribe(key, lambda name, payload, _: reached.append(payload))
    tokens = set()
    car.watch(f"{TOKENS}/**", lambda key, alive: tokens.add(key))
    await car.open()
    car.announce(GRAPH.node_token(car.session_id))
    car.put_latched(STATIC_KEY, b"fixed", encoding=CDR, attachment=NOTE)
    viewer = Bus(client_config(endpoint, tls(keys, "dave")))
    await viewer.open()
    try:
        yield car, viewer, reached, tokens
    finally:
        await viewer.close()
        await car.close()


async def test_a_viewer_sees_the_graph_gets_data_and_what_is_kept_also_when_it_comes_late(guarded):
    car, viewer, _, _ = guarded
    got, graph, kept = [], set(), []
    viewer.subscribe(SCAN_KEY, lambda key, payload, _: got.append(payload))
    viewer.watch(f"{TOKENS}/{DOMAIN}/**", lambda key, alive: graph.add(key))
    session = viewer._open_session
    late = ext.declare_advanced_subscriber(  # as rmw_zenoh declares a transient local subscription
        session, STATIC_KEY, lambda sample: kept.append((sample.payload.to_bytes(), sample.attachment.to_bytes())),
        history=ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
    )  # fmt: skip
    async with asyncio.timeout(5):
        while not (got and graph and kept):
            car.put_attached(SCAN_KEY, b"scan", encoding=CDR, attachment=NOTE)
            await asyncio.sleep(0.02)
    assert (set(got), graph) == ({b"scan"}, {GRAPH.node_token(car.session_id)})
    assert kept == [(b"fixed", NOTE)]
    del late


async def test_a_viewer_neither_publishes_on_a_ros_2_key_nor_invents_a_node_nor_answers_for_the_car(guarded):
    car, viewer, reached, tokens = guarded
    session = viewer._open_session
    drive = f"{DOMAIN}/drive/ackermann_msgs::msg::dds_::AckermannDriveStamped_/RIHS01_0"
    for key in (SCAN_KEY, STATIC_KEY, drive, f"{DOMAIN}/**", "**", f"{STATIC_KEY}/@adv/pub/evil"):
        session.put(key, b"evil", attachment=NOTE)
        session.delete(key)
    held = [session.liveliness().declare_token(f"{TOKENS}/{DOMAIN}/evil/0/0/NN/%/%/evil")]
    asked = []
    held.append(session.declare_queryable(f"{STATIC_KEY}/@adv/**", asked.append))
    got = []
    viewer.subscribe(SCAN_KEY, lambda key, payload, _: got.append(payload))
    async with asyncio.timeout(5):
        while got[-1:] != [b"last"]:
            car.put_attached(SCAN_KEY, b"last", encoding=CDR, attachment=NOTE)
            await asyncio.sleep(0.02)
    replies = await asyncio.to_thread(
        lambda: list(car._open_session.get(f"{STATIC_KEY}/@adv/**?_anyke", zenoh.handlers.FifoChannel(8), timeout=1.0))
    )
    car.poll()
    assert set(reached) <= {b"last", b"fixed"}, "its own"
    assert reached, "the car's ears are open"
    assert asked == []
    assert [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None] == [b"fixed"]
    assert tokens == {GRAPH.node_token(car.session_id)}


async def test_with_the_face_off_no_ros_2_key_leaves_the_car(keys):  # noqa: F811 - the fixture
    endpoint = free_endpoint().replace("tcp/", "tls/")
    car = CarBus(car_config([endpoint], tls(keys, "car"), PEOPLE, "car1"))
    viewer = Bus(client_config(endpoint, tls(keys, "dave")))
    await car.open()
    await viewer.open()
    try:
        graph = set()
        viewer.watch(f"{TOKENS}/**", lambda key, alive: graph.add(key))
        viewer.subscribe(GRAPH.data_key(PUBLISHED[TF_ODOM]), lambda *_: graph.add("data"))
        car.announce(GRAPH.node_token(car.session_id))
        await asyncio.sleep(0.3)
        assert not car.wanted(GRAPH.data_key(PUBLISHED[TF_ODOM]), encoding=CDR)
        assert graph == set()
    finally:
        await viewer.close()
        await car.close()
