"""What a ROS 2 program sees of a car with certificates: all of its graph and data, and it can add nothing to them."""

import asyncio

import pytest
import zenoh
from zenoh import ext

from tests.system.test_attacks import PEOPLE, keys, tls  # noqa: F401 - keys is a fixture
from wallride.runtime.ros.graph import PUBLISHED, SCAN_BY_BEAM, TF_ODOM, TF_STATIC, access
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.car_bus import CarBus
from wallride.runtime.wire.network import CDR, MAX_SAMPLE_BYTES
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.rmw_zenoh import GRAPH as TOKENS
from wallride.runtime.wire.rmw_zenoh import Distro, RosGraph, attachment
from wallride.runtime.wire.zenoh_config import car_config, client_config

pytestmark = pytest.mark.timeout(90)
DOMAIN = 7
GRAPH = RosGraph(DOMAIN, Distro.JAZZY, "wallride_car1")
SCAN_KEY, STATIC_KEY = GRAPH.data_key(PUBLISHED[SCAN_BY_BEAM]), GRAPH.data_key(TF_STATIC)
MAP_KEY, LARGEST_MAP = GRAPH.data_key(PUBLISHED[topics.MAP]), bytes(MAX_SAMPLE_BYTES - 1024)
NOTE = attachment(1, 1, bytes(16))


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
    car.put_latched(MAP_KEY, LARGEST_MAP, encoding=CDR, attachment=NOTE)
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
    late = [
        ext.declare_advanced_subscriber(  # as rmw_zenoh declares a transient local subscription
            session, key, lambda sample: kept.append((sample.payload.to_bytes(), sample.attachment.to_bytes())),
            history=ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
        )
        for key in (STATIC_KEY, MAP_KEY)
    ]  # fmt: skip
    async with asyncio.timeout(5):
        while not (got and graph and len(kept) == 2):
            car.put_attached(SCAN_KEY, b"scan", encoding=CDR, attachment=NOTE)
            await asyncio.sleep(0.02)
    assert (set(got), graph) == ({b"scan"}, {GRAPH.node_token(car.session_id)})
    assert sorted(kept, key=lambda one: len(one[0])) == [(b"fixed", NOTE), (LARGEST_MAP, NOTE)]
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
    assert set(reached) <= {b"last", b"fixed", LARGEST_MAP}, "its own"
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
