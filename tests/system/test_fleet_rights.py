"""Rights at a router of a fleet, with its generated configuration and real certificates: all else is lost."""

import asyncio
import contextlib
import json
import threading
import time
from datetime import UTC, datetime

import pytest

from wallride.clients.fleet.router import read_config
from wallride.clients.keys.folder import KeyFolder
from wallride.runtime.security.key_files import client_keys, uplink_sessions
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.router_config import router_config
from wallride.runtime.wire.uplink import Uplink, UplinkedBus
from wallride.runtime.wire.zenoh_config import Person, Role, Tls, car_config, client_config

NOW = datetime.now(UTC)
MEMBERS = (
    Person("car1", Role.CAR),
    Person("car2", Role.CAR),
    Person("alice", Role.OPERATOR),
    Person("bob", Role.VIEWER),
    Person("slam", Role.PLANNER),
    Person("other", Role.PLANNER),
    Person("eve", Role.OPERATOR),
)
HEARD_S = 0.4
EVIL = b"evil"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """Keys of a fleet, made by the code of `wallride keys`; eve has been revoked."""
    folder = tmp_path_factory.mktemp("fleet")
    keys = KeyFolder(folder)
    keys.make_router("track", ["127.0.0.1"], NOW, 30, renew=False)
    for member in MEMBERS:
        keys.add(member, folder / f"{member.name}-keys", NOW, 30, renew=False)
    keys.revoke("eve", NOW.date())
    return folder


class Scene:
    """A router, two cars with their uplinks, and what each of them took."""

    def __init__(self, fleet, endpoint):
        self.fleet, self.endpoint = fleet, endpoint
        self.taken = {"car1": [], "car2": []}
        self.cars = {}
        self.buses = []

    async def car(self, name, session="0a", highest=Role.OPERATOR):
        configs, _ = uplink_sessions(
            [self.endpoint], self.fleet / f"{name}-keys", name, NOW, ("slam", "other"), highest
        )
        uplink = Uplink(configs[0], name)
        uplink.session = session
        bus = UplinkedBus(car_config([free_endpoint()], None, (), name), [uplink])
        taken = self.taken.setdefault(name, [])
        for key in (topics.COMMAND, "planner/slam/command", "planner/other/command"):
            bus.subscribe(topics.key(name, key), lambda key, payload, _s: taken.append((key, payload)))
        bus.announce(topics.key(name, topics.ALIVE))
        for verb in ("get", "set", "restart", "configure"):
            bus.answer(topics.key(name, f"param/{verb}"), lambda payload, verb=verb: verb.encode())
        await bus.open()
        self.buses.append(bus)
        return bus, uplink

    async def person(self, name):
        bus = Bus(client_config(self.endpoint, client_keys(self.fleet / f"{name}-keys", NOW).tls))
        await bus.open()
        self.buses.append(bus)
        return bus

    async def until(self, condition, within_s=6.0):
        async with asyncio.timeout(within_s):
            while not condition():
                self.poll()
                await asyncio.sleep(0.01)

    def poll(self):
        for bus in self.buses:
            if isinstance(bus, UplinkedBus):
                bus.poll()

    async def listen(self, seconds=HEARD_S):
        for _ in range(round(seconds / 0.02)):
            self.poll()
            await asyncio.sleep(0.02)


@contextlib.asynccontextmanager
async def scene(fleet, *, guarded=True):
    endpoint = free_endpoint().replace("tcp/", "tls/")
    people = [entry.person for entry in KeyFolder(fleet).people() if entry.revoked is None]
    folder = fleet / "track"
    config = router_config([endpoint], Tls(folder / "ca.pem", folder / "track.pem", folder / "track.key"), people, "t")
    if not guarded:
        config["access_control"] = {"enabled": False}
    router = Bus(config)
    await router.open()
    stage = Scene(fleet, endpoint)
    try:
        yield stage
    finally:
        for bus in reversed(stage.buses):
            await bus.close()
        await router.close()


def keys_of(car):
    """Everything that could move or change a car, as exact keys and as wildcards that include them."""
    here = f"wallride/{car}"
    exact = [f"{here}/{key}" for key in ("operator/command", "planner/slam/command", "planner/other/command")]
    return [*exact, f"{here}/operator/*", f"{here}/**", "wallride/*/operator/command", "wallride/**", "**"]


async def attack(stage, bus, until=lambda: True):
    """Try every key; again while a busy machine has dropped some of what may pass."""
    for k in range(20):
        if k >= 3 and until():
            break
        for key in [*keys_of("car1"), *keys_of("car2"), "wallride/car1/status", "wallride/car2/status"]:
            bus.put(key, EVIL, urgent=True)
            await asyncio.sleep(0.002)  # of a burst zenoh lets only the first message through
        await stage.listen(0.05)
    await stage.listen()


async def admitted(stage, *uplinks):
    await stage.until(lambda: all(uplink.problem == "" for uplink in uplinks))


async def test_telemetry_commands_and_questions_pass_through_the_router_to_those_who_may(fleet):
    async with scene(fleet) as stage:
        car, uplink = await stage.car("car1")
        await admitted(stage, uplink)
        alice, bob = await stage.person("alice"), await stage.person("bob")
        heard, cars = [], set()
        bob.subscribe("wallride/*/status", lambda key, payload, _s: heard.append((key, payload)))
        bob.watch("wallride/*/alive", lambda key, alive: cars.add(key) if alive else None)
        await stage.until(lambda: car.wanted("wallride/car1/status"))
        car.put("wallride/car1/status", b"1")
        await stage.until(lambda: heard == [("wallride/car1/status", b"1")] and cars == {"wallride/car1/alive"})
        await stage.until(lambda: alice.wanted("wallride/car1/operator/command"))
        alice.put("wallride/car1/operator/command", b"go", urgent=True)
        await stage.until(lambda: stage.taken["car1"] == [("wallride/car1/operator/command", b"go")])
        for person, verb, answered in (
            (bob, "get", True), (bob, "set", False), (alice, "set", True),
            (bob, "restart", False), (alice, "restart", True),
        ):  # fmt: skip
            asked = asyncio.create_task(person.ask(f"wallride/car1/param/{verb}"))
            await stage.until(asked.done)
            assert asked.result() == ([verb.encode()] if answered else [])


async def test_a_viewer_at_a_router_cannot_publish(fleet):
    async with scene(fleet) as stage:
        _, first = await stage.car("car1")
        _, second = await stage.car("car2")
        await admitted(stage, first, second)
        dave, heard = await stage.person("alice"), []
        dave.subscribe("wallride/**", lambda key, payload, _s: heard.append((key, payload)))
        await attack(stage, await stage.person("bob"))
        assert stage.taken == {"car1": [], "car2": []}
        assert heard == []


async def test_a_planner_at_a_router_feeds_its_own_source_and_nothing_else(fleet):
    async with scene(fleet) as stage:
        _, first = await stage.car("car1")
        _, second = await stage.car("car2")
        await admitted(stage, first, second)
        slam = await stage.person("slam")
        await stage.until(lambda: slam.wanted("wallride/car1/planner/slam/command"))
        await attack(stage, slam, lambda: all(stage.taken.values()))
        assert {key for key, _ in stage.taken["car1"]} == {"wallride/car1/planner/slam/command"}
        assert {key for key, _ in stage.taken["car2"]} == {"wallride/car2/planner/slam/command"}


async def test_a_car_at_a_router_speaks_only_for_itself_and_commands_no_other(fleet):
    async with scene(fleet) as stage:
        _, first = await stage.car("car1")
        await admitted(stage, first)
        bob, heard, cars = await stage.person("bob"), [], set()
        bob.subscribe("wallride/**", lambda key, payload, _s: heard.append(key))
        bob.watch("wallride/*/alive", lambda key, alive: cars.add(key) if alive else None)
        foreign = await stage.person("car2")  # its certificate, without the car's program
        foreign.announce("wallride/car1/alive")
        foreign.announce("wallride/evil/alive")
        await stage.until(lambda: foreign.wanted("wallride/car2/status"))
        await attack(stage, foreign, lambda: heard)
        assert stage.taken["car1"] == []
        assert set(heard) == {"wallride/car2/status"}
        assert cars == {"wallride/car1/alive"}


async def test_a_name_that_was_revoked_has_a_connection_and_nothing_with_it(fleet):
    async with scene(fleet) as stage:
        car, first = await stage.car("car1")
        await admitted(stage, first)
        eve, ears, heard = await stage.person("eve"), await stage.person("eve"), []
        ears.subscribe("wallride/**", lambda key, payload, _s: heard.append(key))
        await attack(stage, eve)
        car.put("wallride/car1/status", b"1")
        await stage.listen()
        assert (stage.taken["car1"], heard) == ([], [])


async def test_what_a_router_itself_invents_is_bounded_by_the_cars_own_access_control(fleet):
    """The router here has no access control at all, as one that was broken into; the attacker is a mere viewer."""
    async with scene(fleet, guarded=False) as stage:
        _, first = await stage.car("car1")
        _, second = await stage.car("car2", highest=Role.VIEWER)
        await admitted(stage, first, second)
        bob = await stage.person("bob")
        await stage.until(lambda: bob.wanted("wallride/car1/operator/command"))
        await attack(stage, bob)
        exact = {
            f"wallride/car1/{key}" for key in ("operator/command", "planner/slam/command", "planner/other/command")
        }
        assert {key for key, _ in stage.taken["car1"]} == exact, "no wildcard came in, and what may come did"
        assert stage.taken["car2"] == [], "connect_role = viewer: the router passes on nothing that moves the car"
        asked = asyncio.create_task(bob.ask("wallride/car1/param/configure"))
        await stage.until(asked.done)
        assert asked.result() == [], "an admin's right is not passed on"


def flood_until(ended, bus, key):
    """Send evenly, more often than any rule lets through; for at most ten seconds."""
    began_s = time.monotonic()
    while not ended.is_set() and time.monotonic() - began_s < 10.0:
        bus.put(key, EVIL, urgent=True)
        time.sleep(0.0001)


@pytest.mark.parametrize("start", range(2))  # zenoh chooses its rule anew with each session
async def test_a_flood_of_a_planner_keeps_no_command_of_an_operator_back(fleet, start):
    async with scene(fleet) as stage:
        _, uplink = await stage.car("car1")
        await admitted(stage, uplink)
        alice, slam = await stage.person("alice"), await stage.person("slam")
        command, plan = "wallride/car1/operator/command", "wallride/car1/planner/slam/command"
        await stage.until(lambda: alice.wanted(command) and slam.wanted(plan))
        ended = threading.Event()
        flood = asyncio.create_task(asyncio.to_thread(flood_until, ended, slam, plan))
        for number in range(75):
            alice.put(command, bytes([number]), urgent=True)
            await stage.listen(0.02)
        ended.set()
        await flood
        await stage.listen()
        taken = [key for key, _ in stage.taken["car1"]]
        assert taken.count(plan) > 75, "it was a flood"
        assert taken.count(command) >= 70, f"start {start}"


async def test_the_second_car_of_a_name_is_refused_seen_and_takes_no_commands(fleet):
    async with scene(fleet) as stage:
        _, first = await stage.car("car1", session="0000000b")
        await admitted(stage, first)
        stage.taken["car1"] = taken = []
        second_bus, second = await stage.car("car1", session="0000000a")  # the lower session, and yet the later one
        bob, tokens = await stage.person("bob"), set()
        for pattern in ("wallride/*/alive/*", "wallride/*/refused/*"):
            bob.watch(pattern, lambda key, alive: (tokens.add if alive else tokens.discard)(key))
        await stage.until(lambda: "another car is called car1" in second.problem)
        assert "0000000b" in second.problem
        await stage.until(lambda: tokens == {"wallride/car1/alive/0000000b", "wallride/car1/refused/0000000a"})
        alice = await stage.person("alice")
        await stage.until(lambda: alice.wanted("wallride/car1/operator/command"))
        alice.put("wallride/car1/operator/command", b"go", urgent=True)
        await stage.listen()
        assert taken == [], "that list is the second car's"
        assert first.problem == ""
        await stage.buses.pop(0).close()  # the first car leaves, and the name is free
        await admitted(stage, second)
        assert second_bus.routers == {stage.endpoint: ""}


async def test_the_written_configuration_is_the_one_that_was_tested(fleet):
    from argparse import Namespace

    from wallride.clients.keys.command import run

    options = Namespace(
        action="router", name="track", dir=fleet, san=[], listen=[], at=None, scan_hz=10.0, days=30, renew=False
    )
    lines = run(options, "unused")
    assert "2 cars, 4 people" in lines[0]
    config = read_config(fleet / "track" / "track.json5")
    people = [entry.person for entry in KeyFolder(fleet).people() if entry.revoked is None]
    folder = (fleet / "track").resolve()
    tls = Tls(folder / "ca.pem", folder / "track.pem", folder / "track.key")
    assert config == json.loads(json.dumps(router_config(["tls/[::]:7449"], tls, people, "track", 10.0)))
