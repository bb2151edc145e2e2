"""The way to a car: found by its token, chosen by name, or one line that says what to do."""

import asyncio
import re
from datetime import UTC, datetime
from functools import partial

import pytest

import wallride
from tests.clients.speaking_car import CarSession, beating_car, client_bus
from tests.typed import typed
from wallride.clients.connection import (
    ConnectionProblemError,
    check_session,
    connected,
    endpoint_of,
    find_car,
    keys_of,
    open_bus,
)
from wallride.clients.endpoints import session_config
from wallride.clients.fleet.search import choose
from wallride.clients.keys.folder import KeyFolder
from wallride.runtime.wire import topics
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.zenoh_config import Person, Role

options = partial(typed, "status")


@pytest.fixture
async def car():
    """A car's session that is not announced."""
    async with CarSession(is_announced=False) as car:
        yield car.bus


@pytest.fixture
async def bus(car):
    """A client's session at that car."""
    async with client_bus(car.endpoint) as bus:
        yield bus


async def test_the_only_car_is_found_without_its_name(car):
    car.announce(topics.key("car1", topics.ALIVE))
    async with connected(options("--connect", car.endpoint)) as (bus, name):
        assert name == "car1"
        assert bus.is_open
    assert not bus.is_open


async def test_only_the_start_of_the_car_that_is_meant_will_do():
    async with beating_car(session=0xCAFE) as (endpoint, _):
        async with connected(options("--connect", endpoint, "--session", "0000cafe")) as (_, name):
            assert name == "car1"
        with pytest.raises(ConnectionProblemError, match="car1 has session 0000cafe, wanted was 0000beef"):
            async with connected(options("--connect", endpoint, "--session", "beef")):
                pass


async def test_a_car_without_a_heartbeat_is_not_the_one_that_is_meant(bus):
    with pytest.raises(ConnectionProblemError, match="has no heartbeat"):
        await check_session(bus, "car1", 0xCAFE, timeout_s=0.1)


async def test_of_several_cars_one_must_be_chosen(car):
    for name in ("car1", "car2"):
        car.announce(topics.key(name, topics.ALIVE))
    async with client_bus(car.endpoint) as bus:
        with pytest.raises(ConnectionProblemError, match="car1, car2; choose with --car"):
            await find_car(bus, None)
        assert await find_car(bus, "car2") == "car2"


async def test_a_car_that_is_not_there_is_named_and_so_are_those_that_are(car, bus):
    with pytest.raises(ConnectionProblemError, match="a car is not there"):
        await find_car(bus, None, timeout_s=0.1)
    car.announce(topics.key("car1", topics.ALIVE))
    with pytest.raises(ConnectionProblemError, match=r"no car car9 at .*; there is car1"):
        await find_car(bus, "car9", timeout_s=0.5)
    with pytest.raises(ConnectionProblemError, match="is not a car's name"):
        await find_car(bus, "*")


async def test_nobody_listening_is_one_line_with_the_endpoint():
    endpoint = free_endpoint()
    with pytest.raises(ConnectionProblemError, match=re.escape(f"cannot connect to {endpoint}")) as caught:
        await open_bus(options("--connect", endpoint))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("tcp/127.0.0.1:7447", "tcp/127.0.0.1:7447"),
        ("car1.local", "tcp/car1.local:7447"),
        ("10.0.0.5:7000", "tcp/10.0.0.5:7000"),
        ("tls/car1.local", "tls/car1.local:7448"),
        ("tls/[fe80::1]:7448", "tls/[fe80::1]:7448"),
    ],
)
def test_an_endpoint_may_be_written_short(text, endpoint):
    assert endpoint_of(text) == endpoint


def test_with_keys_the_short_form_is_an_encrypted_one():
    assert endpoint_of("car1.local", with_keys=True) == "tls/car1.local:7448"


@pytest.mark.parametrize("text", ["http/x:1", "tcp/", "tcp/a b:1", "udp/car1:7447"])
def test_a_wrong_endpoint_is_refused_with_an_example(text):
    with pytest.raises(ConnectionProblemError, match="write tcp/HOST:PORT"):
        endpoint_of(text)


def test_an_ipv6_address_with_keys_is_one_line_with_the_reason(tmp_path):
    keys = KeyFolder(tmp_path / "car")
    keys.begin("car1", [], datetime.now(UTC), 10, renew=False)
    keys.add(Person("vera", Role.VIEWER), tmp_path / "vera", datetime.now(UTC), 10, renew=False)
    with pytest.raises(ConnectionProblemError, match=r"tls/\[::1\]:7448: .*IPv6 address; use the car's name"):
        session_config("tls/[::1]:7448", keys_of("tls/[::1]:7448", tmp_path / "vera"))


def test_an_encrypted_endpoint_needs_a_folder_of_keys(tmp_path):
    assert keys_of("tcp/car1:7447", None) is None
    with pytest.raises(ConnectionProblemError, match=r"tls/car1:7448 needs keys: .*nothing: no such folder"):
        keys_of("tls/car1:7448", tmp_path / "nothing")
    with pytest.raises(ConnectionProblemError, match="holds no key instead of one"):
        keys_of("tls/car1:7448", tmp_path)


async def test_a_car_that_is_silent_towards_a_name_is_explained(bus):
    with pytest.raises(ConnectionProblemError, match="anna is revoked or not listed there"):
        await find_car(bus, None, whose="anna", timeout_s=0.1)


@pytest.mark.parametrize("by", ["option", "variable"])
async def test_of_several_endpoints_that_of_the_car_is_found(monkeypatch, by):
    async with CarSession("car1") as first, CarSession("car2") as second:
        places = f"{first.endpoint},{free_endpoint()}, {second.endpoint}"
        monkeypatch.setenv("WALLRIDE_CONNECT", places if by == "variable" else "")
        given = ("--connect", places) if by == "option" else ()
        async with connected(options(*given, "--car", "car2")) as (bus, name):
            assert (name, bus.endpoint) == ("car2", second.endpoint)
        with pytest.raises(ConnectionProblemError, match=r"several cars .*: car1, car2; choose with --car"):
            async with connected(options(*given)):
                pass

        def script():
            with wallride.connect("car2", at=places if by == "option" else None) as remote:
                return remote.name, remote._options.connect

        assert await asyncio.to_thread(script) == ("car2", second.endpoint)


async def test_of_several_endpoints_the_only_car_is_found_without_its_name():
    async with (
        CarSession() as first,
        connected(options("--connect", f"{free_endpoint()},{first.endpoint}")) as (bus, name),
    ):
        assert (name, bus.endpoint) == ("car1", first.endpoint)


A, B = "tcp/a:1", "tcp/b:1"


def test_a_car_by_two_routers_is_one_and_two_cars_of_one_name_are_two():
    assert choose({A: {"car1": "0a"}, B: {"car1": "0a"}}, {}, "car1", "", "--connect") == ("car1", A)
    two = {A: {"car1": "0a"}, B: {"car1": "0b"}}
    with pytest.raises(ConnectionProblemError, match=r"two cars are called car1: session 0a at tcp/a:1, session 0b"):
        choose(two, {}, None, "", "--connect")
    assert choose(two, {}, None, "0b", "--connect") == ("car1", B)


def test_a_car_at_no_endpoint_is_an_error_with_what_is_where_and_who_said_so():
    with pytest.raises(ConnectionProblemError) as caught:
        choose({A: {"car1": "0a"}, B: {}}, {B: "refused"}, "car9", "", "WALLRIDE_CONNECT")
    assert str(caught.value) == f"no car car9 at the endpoints of WALLRIDE_CONNECT. {A}: car1; {B}: refused"


@pytest.mark.parametrize(("place", "said"), [("udp/car1:1", "write tcp/HOST"), ("tcp/127.0.0.1:9", "cannot connect")])
async def test_an_error_names_the_variable_that_the_endpoint_came_from(monkeypatch, place, said):
    monkeypatch.setenv("WALLRIDE_CONNECT", place)
    with pytest.raises(ConnectionProblemError, match=said) as caught:
        await open_bus(options())
    assert "WALLRIDE_CONNECT" in str(caught.value)
