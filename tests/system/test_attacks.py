"""Who is not invited gets nothing through: the car's own session with its shipped access control, attacked for real.

Every attack is also run once with the access control switched off, where each of them must succeed: otherwise the
tests above would prove nothing.
"""

import asyncio
import contextlib
import copy
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from tests.system.attacker import (
    ASKED,
    COMMAND,
    EVIL,
    FALSE_OPERATORS,
    HERE,
    OTHERS,
    SECRET,
    STATUS,
    WILD,
    Attacker,
    Loot,
)
from tests.waiting import until
from wallride.clients.keys.authority import Authority, KeyPair
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import JSON, RefusedError
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.teleop import COMMAND_BYTES
from wallride.runtime.wire.zenoh_config import Person, Role, Tls, car_config, client_config

MODES = ("client", "peer", "router")
PEOPLE = (
    Person("alice", Role.OPERATOR),
    Person("bob", Role.VIEWER),
    Person("dave", Role.VIEWER),
    Person("root", Role.ADMIN),
)


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """A folder with the keys of the car, of people, and of a stranger whose own authority calls him alice."""
    folder, now = tmp_path_factory.mktemp("keys"), datetime.now(UTC)

    def save(name: str, pair: KeyPair) -> None:
        (folder / f"{name}.pem").write_bytes(pair.certificate_pem)
        (folder / f"{name}.key").write_bytes(pair.key_pem)

    ours, theirs = Authority.make("car1", now), Authority.make("car1", now)
    save("ca", ours)
    authority = Authority(ours)
    save("car", authority.certify_car("car1", ["car1", "localhost", "127.0.0.1"], now, 365))
    save("car2", authority.certify_car("car2", ["car2", "car2.local"], now, 365))
    for name in ("alice", "bob", "dave", "root", "mallory"):
        save(name, authority.certify_person(name, "admin", now, 365))  # what it says about its role must not matter
    save("stranger", Authority(theirs).certify_person("alice", "admin", now, 365))
    return folder


def tls(folder: Path, name: str) -> Tls:
    return Tls(folder / "ca.pem", folder / f"{name}.pem", folder / f"{name}.key")


@dataclass
class Heard:
    """What reached somebody."""

    samples: list[tuple[str, bytes]] = field(default_factory=list)
    tokens: set[str] = field(default_factory=set)

    def listen(self, bus: Bus, key: str) -> None:
        bus.subscribe(key, lambda name, payload, _: self.samples.append((name, payload)))

    def watch(self, bus: Bus, key: str) -> None:
        bus.watch(key, lambda name, alive: self.tokens.add(name) if alive else None)

    def evil(self) -> list[tuple[str, bytes]]:
        return [(name, payload) for name, payload in self.samples if payload in {EVIL, b""}]


@dataclass
class Stage:
    """A car, its honest operator and an honest viewer, all of them connected."""

    folder: Path
    endpoint: str
    car: Bus
    operator: Bus
    viewer: Bus
    at_car: Heard = field(default_factory=Heard)
    at_operator: Heard = field(default_factory=Heard)
    at_viewer: Heard = field(default_factory=Heard)
    asked: list[tuple[str, bytes]] = field(default_factory=list)

    async def open(self) -> None:
        car = self.car
        self.at_car.listen(car, COMMAND)
        for parts in ("*", "*/*", "*/*/*"):  # wider than what the car subscribes to, so that nothing goes unnoticed
            self.at_car.listen(car, f"{HERE}/{parts}")
            self.at_car.watch(car, f"wallride/*/{parts}")
        for name in ASKED:
            car.answer(f"{HERE}/{name}", lambda payload, name=name: self._answer(name, payload))
        car.announce(f"{HERE}/alive")
        for bus, heard in ((self.operator, self.at_operator), (self.viewer, self.at_viewer)):
            heard.listen(bus, f"{HERE}/*")
            heard.watch(bus, "wallride/*/alive")
        self.operator.announce(f"{HERE}/operator/alive/a11ce")
        await car.open()
        await self.operator.open()
        await self.viewer.open()
        await self.works()

    def _answer(self, name: str, payload: bytes) -> bytes:
        self.asked.append((name, payload))
        if payload == b"wrong":
            raise RefusedError("out of range")
        return b"true"

    async def works(self) -> None:
        """What is allowed does get through: without this the tests could not fail."""
        async with asyncio.timeout(10):
            while (COMMAND, SECRET) not in self.at_car.samples:
                self.operator.put(COMMAND, SECRET, urgent=True)
                await asyncio.sleep(0.02)
            self.at_car.samples.clear()
            for heard in (self.at_operator, self.at_viewer):
                heard.samples.clear()
                while (STATUS, b"true") not in heard.samples:
                    self.car.put(STATUS, b"true")
                    await asyncio.sleep(0.02)
                while f"{HERE}/alive" not in heard.tokens:
                    await asyncio.sleep(0.02)
            while f"{HERE}/operator/alive/a11ce" not in self.at_car.tokens:
                await asyncio.sleep(0.02)
            assert await self.operator.ask(f"{HERE}/param/set", b"kp") == [b"true"]
            assert await self.viewer.ask(f"{HERE}/param/get", b"kp") == [b"true"]
        self.asked.clear()

    async def close(self) -> None:
        for bus in (self.viewer, self.operator, self.car):
            await bus.close()


@contextlib.asynccontextmanager
async def staged(folder: Path, *, guarded: bool = True):
    endpoint = free_endpoint().replace("tcp/", "tls/")
    config = car_config([free_endpoint(), endpoint], tls(folder, "car"), PEOPLE, "car1")
    if not guarded:
        config["access_control"] = {"enabled": False}
        del config["downsampling"], config["low_pass_filter"]
    operator, viewer = (Bus(client_config(endpoint, tls(folder, name))) for name in ("alice", "dave"))
    stage = Stage(folder, endpoint, Bus(config), operator, viewer)
    try:
        await stage.open()
        yield stage
    finally:
        await stage.close()


def attacking(stage: Stage, name: str, mode: str) -> dict[str, Any]:
    """Return a session's configuration in one of zenoh's modes with somebody's certificate, or with none."""
    config = copy.deepcopy(client_config(stage.endpoint, tls(stage.folder, "alice" if name == "nobody" else name)))
    config["mode"] = mode
    if name == "nobody":
        config["transport"]["link"]["tls"] = {"root_ca_certificate": str(stage.folder / "ca.pem")}
    if mode != "client":
        config["listen"] = {"endpoints": []}
    return config


async def assault(stage: Stage, attacker: Attacker) -> list[list[bytes]]:
    """Run all attacks while the honest operator works; returns what the operator was answered meanwhile."""
    answers: list[list[bytes]] = []
    if not await attacker.open():
        return answers
    try:
        attacker.lay_traps()
        await asyncio.sleep(0.1)
        striking = asyncio.create_task(attacker.strike())
        until_s = time.monotonic() + 0.5
        while time.monotonic() < until_s or not striking.done() or len(answers) < 3:
            stage.operator.put(COMMAND, SECRET, urgent=True)
            stage.car.put(STATUS, b"true")
            answers.append(await stage.operator.ask(f"{HERE}/param/get", b"kp"))
            await asyncio.sleep(0.02)
        await striking
        await asyncio.sleep(0.1)
    finally:
        await attacker.close()
    return answers


def assert_nothing_got_through(stage: Stage, loot: Loot, answers: list[list[bytes]], *, hears: bool) -> None:
    assert stage.at_car.evil() == []
    assert {key for key, _ in stage.at_car.samples} <= {COMMAND, STATUS}  # its own status: it listens wide here
    assert stage.car.strays == 0, "the access control alone must have kept wildcards out"
    assert stage.at_operator.evil() == []
    assert stage.at_viewer.evil() == []
    assert stage.at_car.tokens == {f"{HERE}/alive", f"{HERE}/operator/alive/a11ce"}
    assert stage.at_operator.tokens == stage.at_viewer.tokens == {f"{HERE}/alive"}
    assert all(answer == [b"true"] for answer in answers)
    assert not [name for name, payload in stage.asked if payload == EVIL]
    assert {key for key, _ in loot.overheard} == ({STATUS} if hears else set())
    assert (loot.operators, loot.captured, loot.answers) == ([], [], [])


@pytest.mark.parametrize("mode", MODES)
async def test_a_viewer_cannot_drive_answer_pretend_or_overhear(keys, mode):
    async with staged(keys) as stage:
        attacker = Attacker(attacking(stage, "bob", mode), may_ask=("param/list", "param/get", "param/history"))
        answers = await assault(stage, attacker)
        assert len(answers) > 2
        assert_nothing_got_through(stage, attacker.loot, answers, hears=True)
        await stage.works()


@pytest.mark.parametrize("mode", MODES)
async def test_a_certificate_of_our_own_authority_that_is_not_listed_is_worth_nothing(keys, mode):
    async with staged(keys) as stage:
        attacker = Attacker(attacking(stage, "mallory", mode))
        answers = await assault(stage, attacker)
        assert len(answers) > 2, "it gets a connection, and nothing with it"
        assert_nothing_got_through(stage, attacker.loot, answers, hears=False)
        await stage.works()


@pytest.mark.parametrize("name", ["stranger", "nobody"])
@pytest.mark.parametrize("mode", MODES)
async def test_a_stranger_who_calls_himself_alice_or_nobody_at_all_does_not_get_in(keys, mode, name):
    async with staged(keys) as stage:
        attacker = Attacker(attacking(stage, name, mode))
        answers = await assault(stage, attacker)
        assert_nothing_got_through(stage, attacker.loot, answers, hears=False)
        await stage.works()


@pytest.mark.parametrize("mode", MODES)
async def test_an_operator_may_command_this_car_and_no_more(keys, mode):
    async with staged(keys) as stage:
        config = attacking(stage, "alice", mode)
        attacker = Attacker(
            config, may_command=True, may_ask=tuple(name for name in ASKED if name not in {"record", "param/configure"})
        )
        answers = await assault(stage, attacker)
        stage.at_car.tokens -= FALSE_OPERATORS  # an operator may have any number of sessions,
        attacker.loot.operators.clear()  # and see who else operates
        assert_nothing_got_through(stage, attacker.loot, answers, hears=True)
        await stage.works()


async def test_operators_see_each_other_and_viewers_do_not(keys):
    token = f"{HERE}/operator/alive/a11ce"
    async with staged(keys) as stage:
        heard = {name: Heard() for name in ("bob", "root")}
        buses = {name: Bus(client_config(stage.endpoint, tls(keys, name))) for name in heard}
        for name, bus in buses.items():
            heard[name].watch(bus, f"{HERE}/operator/alive/*")
            await bus.open()
        await until(lambda: token in heard["root"].tokens)
        await asyncio.sleep(0.1)
        assert heard["bob"].tokens == set()
        for bus in buses.values():
            await bus.close()


@pytest.mark.parametrize("mode", MODES)
async def test_each_of_these_attacks_succeeds_where_the_access_control_is_off(keys, mode):
    async with staged(keys, guarded=False) as stage:
        attacker = Attacker(attacking(stage, "bob", mode))
        answers = await assault(stage, attacker)
        hit = {key for key, _ in stage.at_car.evil()}
        assert hit >= {COMMAND, *OTHERS}
        assert any(payload == b"" for _, payload in stage.at_car.samples), "deletes too"
        assert stage.car.strays >= len(WILD), "wildcards reach every subscription, and the bus drops them"
        assert {key for key, _ in stage.at_viewer.evil()} >= {STATUS, f"{HERE}/beat"}
        assert stage.at_car.tokens >= {"wallride/car2/alive", f"{HERE}/operator/alive/e0e0"}
        assert stage.at_operator.tokens >= {"wallride/car2/alive", "wallride/evil/alive"}
        assert any(EVIL in answer for answer in answers), "a viewer answers in the car's name"
        assert {name for name, payload in stage.asked if payload == EVIL} >= {"param/set", "param/save", "record"}
        loot = attacker.loot
        assert (COMMAND, SECRET) in loot.overheard
        assert f"{HERE}/operator/alive/a11ce" in loot.operators
        assert loot.captured


async def test_neither_a_viewer_nor_another_car_can_pose_as_the_car(keys):
    lure = free_endpoint().replace("tcp/", "tls/")
    for name, fooled in (("bob", False), ("car2", False), ("car", True)):
        false_car = Bus(car_config([lure], tls(keys, name), PEOPLE, "car1"))
        await false_car.open()
        victim = Bus(client_config(lure, tls(keys, "alice")))
        try:
            if fooled:  # the control: with the car's own certificate this very session opens
                await victim.open()
            else:
                with pytest.raises(OSError, match="onnect"):
                    await victim.open()
        finally:
            await victim.close()
            await false_car.close()


async def test_the_car_does_not_gather_a_flood_in_pieces(keys):
    largest = COMMAND_BYTES
    async with staged(keys) as stage:
        async with asyncio.timeout(5):
            while not any(len(payload) == largest for _, payload in stage.at_car.samples):
                stage.operator.put(COMMAND, b"x" * largest, encoding=JSON)
                await asyncio.sleep(0.05)
        for too_large in (COMMAND_BYTES + 1, 500_000, 3_000_000) * 3:
            stage.operator.put(COMMAND, b"x" * too_large, encoding=JSON)
            await asyncio.sleep(0.05)
        assert max(len(payload) for _, payload in stage.at_car.samples) == largest
        await stage.works()


async def test_on_the_car_itself_no_certificate_is_needed(keys):
    here = free_endpoint()
    away = free_endpoint().replace("tcp/", "tls/")
    car = Bus(car_config([here, away], tls(keys, "car"), PEOPLE, "car1"))
    local = Bus(client_config(here, None))
    heard = Heard()
    heard.listen(car, COMMAND)
    await car.open()
    await local.open()
    async with asyncio.timeout(10):
        while (COMMAND, SECRET) not in heard.samples:
            local.put(COMMAND, SECRET)
            await asyncio.sleep(0.02)
    await local.close()
    await car.close()
