"""Planners outside a real car: a script, a ROS 2 program that is not ours, and certificates that may do only this."""

import asyncio
import os
import sys
import time
from functools import partial
from pathlib import Path

import pytest

import wallride
from tests.system.operated import CAR, operated
from tests.system.test_attacks import keys, tls  # noqa: F401 - keys is a fixture
from wallride.clients.remote.planner import PlanRefusedError
from wallride.runtime.ros import messages
from wallride.runtime.ros.graph import DRIVE, access
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.car_bus import CarBus
from wallride.runtime.wire.network import CDR
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.rmw_zenoh import Distro, RosGraph, attachment
from wallride.runtime.wire.zenoh_config import Person, Role, car_config, client_config

pytestmark = pytest.mark.timeout(90)
DRIVER = Path(__file__).resolve().parents[2] / "docs" / "examples" / "ros2_drive.py"
DOMAIN = 7
FOREIGN_MPS, PLANNED_MPS = 1.8, 0.6
GRAPH = RosGraph(DOMAIN, Distro.JAZZY, "wallride_car1")
DRIVE_KEY = GRAPH.data_key(DRIVE)
PEOPLE = (
    Person("alice", Role.OPERATOR),
    Person("bob", Role.PLANNER),
    Person("dave", Role.PLANNER),
    Person("root", Role.VIEWER),
)


async def test_a_ros_2_program_that_is_not_ours_drives_through_drive_and_its_end_stops_the_car(tmp_path):
    settings = ("ros2.enabled=true", "ros2.drive=true", f"ros2.domain={DOMAIN}", "planners.enabled=true")
    async with operated(tmp_path, *settings) as scene:
        await scene.car.until_driving()
        process = await asyncio.create_subprocess_exec(
            sys.executable, str(DRIVER), scene.entrance, "60", str(FOREIGN_MPS), "0.1",
            stderr=asyncio.subprocess.PIPE, env={**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)},
        )  # fmt: skip
        try:
            await scene.car.until(lambda: scene.car.wheel_mps > 0.95 * FOREIGN_MPS, "driving through /drive", 20.0)
            await scene.car.until(lambda: planners(scene)["driving"] == "ros2", "its name in the status")
        finally:
            process.kill()
            await process.wait()
        ended_s = time.monotonic()
        braked_s = await scene.brake_after(ended_s)
        await scene.car.until(lambda: planners(scene)["lost"] == "ros2", "lost, in the status")
        await scene.car.until(lambda: abs(scene.car.wheel_mps) < 0.05, "standing")
        assert not [at_s for at_s in scene.moves_after(braked_s) if at_s > braked_s + 0.1], "the follower stays out"
        assert set(planners(scene)["planners"]["ros2"]["refused"]) <= {"clock not compared yet", "stale"}


class RosHand:
    """A bare zenoh session that writes on /drive what it likes."""

    def __init__(self, endpoint, gid):
        self._bus, self._gid, self._sequence = Bus(client_config(endpoint, None)), gid, 0

    async def open(self):
        await self._bus.open()

    async def close(self):
        await self._bus.close()

    def say(self, speed_mps, *, payload=None, key=DRIVE_KEY, age_s=0.0):
        self._sequence += 1
        note = attachment(self._sequence, time.time_ns() - round(age_s * 1e9), self._gid)
        sent = messages.ackermann(0, speed_mps, 0.0) if payload is None else payload
        self._bus.put_attached(key, sent, encoding=CDR, attachment=note)


async def test_a_running_car_refuses_counts_and_names_what_a_hostile_ros_2_program_says(tmp_path):
    settings = ("ros2.enabled=true", "ros2.drive=true", f"ros2.domain={DOMAIN}", "planners.enabled=true")
    async with operated(tmp_path, *settings) as scene:
        await scene.car.until_driving()
        good, other = RosHand(scene.entrance, b"g" * 16), RosHand(scene.entrance, b"o" * 16)
        await good.open()
        await other.open()
        kind, type_hash = DRIVE_KEY.split("/")[2:]
        whole, fastest_mps, drove = messages.ackermann(0, 9.0, 0.0), 0.0, False
        try:
            hostile = (
                partial(good.say, 9.0, age_s=2.0),
                partial(good.say, 9.0, payload=whole[:-1]),
                partial(good.say, 9.0, payload=whole[:12] + b"\xff" * 4 + whole[16:]),
                partial(good.say, 9.0, key=f"{DOMAIN}/drive/{kind}/RIHS01_{'0' * 64}"),
                partial(good.say, 9.0, key=f"{DOMAIN}/drive/geometry_msgs::msg::dds_::Twist_/{type_hash}"),
                partial(other.say, 9.0),
            )
            for step in range(180):
                good.say(PLANNED_MPS)
                await asyncio.sleep(0.02)  # the car bounds the rate of each key
                if step > 60:
                    hostile[step % len(hostile)]()
                    await asyncio.sleep(0.02)
                fastest_mps = max(fastest_mps, scene.car.wheel_mps)
                drove |= planners(scene)["driving"] == "ros2"
            await asyncio.sleep(0.3)
            refused = planners(scene)["planners"]["ros2"]["refused"]
        finally:
            await good.close()
            await other.close()
        kinds = ("stale", "malformed", "another message type", "too many sessions")
        assert all(refused.get(kind, 0) >= 5 for kind in kinds), refused
        assert drove, "the good one's fresh commands count all the while"
        assert fastest_mps < 2 * PLANNED_MPS, "none of the 9 m/s"


async def test_a_script_plans_by_its_name_stalls_and_says_goodbye(tmp_path):
    async with operated(tmp_path, "planners.enabled=true", 'planners.names=["slam"]') as scene:
        await scene.car.until_driving()
        stalled = asyncio.Event()
        loop = asyncio.get_running_loop()

        def plan(seconds, *, stalls):
            with wallride.connect(CAR, at=scene.entrance) as car, car.plan("slam") as slam:
                until_s = time.monotonic() + seconds
                while time.monotonic() < until_s:
                    slam.send(PLANNED_MPS, 0.1)
                    time.sleep(0.02)
                if stalls:
                    loop.call_soon_threadsafe(stalled.set)
                    time.sleep(1.5)

        planning = asyncio.create_task(asyncio.to_thread(plan, 3.0, stalls=True))
        await scene.car.until(lambda: planners(scene)["driving"] == "slam", "its name in the status")
        await scene.car.until(lambda: abs(scene.car.wheel_mps - PLANNED_MPS) < 0.05, "driving as planned")
        await stalled.wait()
        await scene.brake_after(time.monotonic())
        await scene.car.until(lambda: planners(scene)["lost"] == "slam", "lost, in the status")
        with pytest.raises(PlanRefusedError, match="nothing was sent"):
            await planning
        await asyncio.to_thread(plan, 1.0, stalls=False)
        await scene.car.until_driving()  # it said goodbye: the follower goes on, where no permit is needed
        await scene.car.until(lambda: planners(scene)["driving"] == planners(scene)["lost"] == "", "no planner")


def planners(scene):
    return scene.status.get("planners") or {"driving": None, "lost": None}


@pytest.mark.parametrize("name", ["bob", "root"])
async def test_a_planners_certificate_feeds_its_own_source_and_nothing_else(keys, name):  # noqa: F811 - the fixture
    endpoint = free_endpoint().replace("tcp/", "tls/")
    car = CarBus(car_config([endpoint], tls(keys, "car"), PEOPLE, "car1", access(GRAPH, drives=True)))
    reached = set()
    for key in ("wallride/**", f"{DOMAIN}/**"):
        car.subscribe(key, lambda key, payload, _: reached.add((key, payload)))

    def asked(payload):
        reached.add(("asked", payload))
        return b""

    for verb in ("param/set", "record", "logs/get"):
        car.answer(topics.key("car1", verb), asked)
    await car.open()
    sender = Bus(client_config(endpoint, tls(keys, name)))
    await sender.open()
    session = sender._open_session
    own = topics.planner_key("car1", name)
    forbidden = [
        topics.planner_key("car1", "dave"), topics.planner_key("car1", "*"), topics.key("car1", topics.COMMAND),
        topics.key("car1", topics.STATUS), topics.planner_key("car2", name), GRAPH.data_key(DRIVE), "wallride/**", "**",
    ]  # fmt: skip
    try:
        async with asyncio.timeout(10):
            for _ in range(10):
                for key, payload in [(own, b"own"), *((key, b"evil") for key in forbidden)]:
                    session.put(key, payload)
                    await asyncio.sleep(
                        0.005
                    )  # of a burst only the first message gets in (wallride.runtime.wire.ingress)
                    session.delete(key)
                    await asyncio.sleep(0.005)
                    car.poll()
            for verb in ("param/set", "record", "logs/get"):
                assert await sender.ask(topics.key("car1", verb), b"evil", timeout_s=0.3) == []
            car.poll()
    finally:
        await sender.close()
        await car.close()
    assert reached == ({(own, b"own")} if name == "bob" else set()), "root is a viewer here"


async def test_the_certificate_of_ros_2_may_publish_on_drive(keys):  # noqa: F811 - the fixture
    grants = car_config(
        ["tls/[::]:7448"], tls(keys, "car"), (Person("ros2", Role.PLANNER), PEOPLE[1]), "car1",
        access(GRAPH, drives=True),
    )["access_control"]  # fmt: skip
    puts = {
        rule["id"]: rule["key_exprs"] for rule in grants["rules"]
        if "put" in rule["messages"] and rule["flows"] == ["ingress"]
    }  # fmt: skip
    assert puts["plan-ros2"] == [topics.planner_key("car1", "ros2"), GRAPH.data_key(DRIVE)]
    assert puts["plan-bob"] == [topics.planner_key("car1", "bob")]
    assert {"subjects": ["planner-bob"], "rules": ["plan-bob", "plan-bob-heard"]} in grants["policies"]
