"""`wallride cars` and `wallride stop`: every car is listed, and none is said to stand that may not."""

import json
import re
import time
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from tests.clients.speaking_car import CarSession, beating_car, client_bus, options, speaking_car
from tests.typed import telling
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.fleet import cars as fleet_cars
from wallride.clients.fleet import stop as fleet_stop
from wallride.clients.fleet.links import FleetLink
from wallride.runtime.wire import topics
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.teleop import Beat, CarCondition, read_command

stop_options = partial(telling, "stop")


async def test_cars_are_listed_with_version_and_state():
    async with speaking_car("blue") as car:
        car.announce(topics.key("mute", topics.ALIVE))
        parsed, said = options(car, "cars")
        assert await fleet_cars.run(parsed) == 0
        blue, mute = said
        assert blue.split()[:3] == ["blue", "9.9", "driving"]
        assert "says nothing" in mute
        parsed, said = options(car, "cars", "--json", "--car", "blue")
        await fleet_cars.run(parsed)
        assert json.loads(said[0])["blue"]["state"] == "driving"


async def test_no_car_is_an_answer_too():
    async with CarSession(is_announced=False) as car:
        parsed, said = options(car, "cars")
        assert await fleet_cars.run(parsed) == 1
    assert said == [f"no car at {car.endpoint}"]


async def test_cars_of_several_endpoints_and_one_that_is_away():
    away = free_endpoint()
    async with speaking_car("blue") as blue, speaking_car("red") as red:
        parsed, said = options(blue, "cars")
        parsed.connect = f"{blue.endpoint},{away},{red.endpoint}"
        assert await fleet_cars.run(parsed) == 0
        assert [line.split()[0] for line in said[:2]] == ["blue", "red"]
        assert said[2].startswith(f"{away}: ")


STATUS = "wallride/car1/status"


def deaf_link(endpoint, put=None) -> Any:
    """Return a link of which only the endpoint and what is put on it matter."""
    bus: Any = SimpleNamespace(subscribe=lambda *_: None, watch=lambda *_: None, put=put, endpoint=endpoint)
    return FleetLink(bus, "")


def status_of(session, state="driving"):
    return topics.encode({"car": "car1", "session": session, "state": state, "version": "9", "output": None})


def test_the_state_is_the_documented_one():
    view, link = fleet_cars.FleetView([]), deaf_link("tcp/a:1")
    view._on_token(link, "wallride/car1/alive", True)
    status = json.loads(status_of("0a", "standing")) | {"condition": {"state": "waiting for device"}}
    view._on_status(link, STATUS, topics.encode(status), 10.0)
    (line,) = fleet_cars.table(view.fields(None, 10.5))
    assert "waiting for device stands" in line


def test_two_cars_of_one_name_are_two_rows_and_said():
    links = [deaf_link("tcp/a:1"), deaf_link("tcp/b:1")]
    view = fleet_cars.FleetView(links)
    for link, session in zip(links, ("0a", "0b"), strict=True):
        view._on_token(link, "wallride/car1/alive", True)
        view._on_status(link, STATUS, status_of(session), 10.0)
    lines = list(fleet_cars.table(view.fields(None, 10.5)))
    assert len(lines) == 2
    assert all("two cars are called so" in line for line in lines)
    view._on_status(links[1], STATUS, status_of("0b"), 12.0)  # the other is silent: a restart, not a second car
    assert [row["trouble"] for row in view.fields(None, 12.0)] == [""]


ODD = (
    {"gates": 3}, {"gates": {"motor": [1]}}, {"condition": "x"}, {"battery": 7}, {"distance_error": [1]},
    {"output": {"winner": "x"}}, {"output": {"winner": "x", "reason": "y", "speed_mps": "fast"}}, {"speed_mps": "fast"},
    {"session": {"a": 1}}, {"version": "9" * 99}, {"stamp_s": "b"},
)  # fmt: skip


def two_cars():
    """Return a view of car1, which has said how it is, and of car2, which has said nothing yet; and their link."""
    link = deaf_link("tcp/a:1")
    view = fleet_cars.FleetView([link])
    for name in ("car1", "car2"):
        view._on_token(link, f"wallride/{name}/alive", True)
    view._on_status(link, STATUS, status_of("0a"), 10.0)
    return view, link


@pytest.mark.parametrize(
    "payload", [*map(json.dumps, ODD), "[]", "{", "[" * 60_000, '{"state": "\\ud800"}', '{"odom": {"x_m": 1e999}}']
)
def test_an_odd_status_is_the_trouble_of_its_own_row_and_nothing_of_it_is_used(payload):
    view, link = two_cars()
    view._on_status(link, "wallride/car2/status", payload.encode(), 10.0)
    first, second = view.fields(None, 10.5)
    assert (first["trouble"], first["status"]["state"]) == ("", "driving")
    assert (second["trouble"], second["status"], second["age_s"]) == (fleet_cars.UNREADABLE, {}, None)
    lines = list(fleet_cars.table([first, second]))
    assert lines[0].split()[:3] == ["car1", "9", "driving"]
    assert lines[1].endswith(fleet_cars.UNREADABLE)
    view._on_status(link, "wallride/car2/status", status_of("0b"), 12.0)
    assert [row["trouble"] for row in view.fields("car2", 12.0)] == [""], "it is over with what can be read"


def test_a_row_that_cannot_be_shown_and_an_escape_sequence_leave_the_other_rows():
    view, link = two_cars()
    view._on_status(link, "wallride/car2/status", status_of("0b", "\x1b[2J\n"), 10.0)
    first, second = view.fields(None, 10.5)
    assert list(fleet_cars.table([first, second]))[1].split()[2] == r"\x1b[2J\n"
    odd = {**second, "status": {"gates": 3}}  # as if the check of the shape had a gap
    assert [line.split()[0] for line in fleet_cars.table([first, odd])] == ["car1", "car2"]


def test_a_car_that_names_ever_new_sessions_fills_neither_the_memory_nor_the_list():
    view, link = two_cars()
    for number in range(100):
        view._on_status(link, "wallride/car2/status", status_of(f"{number:x}"), 10.0 + number / 1000)
        view._on_refused(link, f"wallride/car2/refused/{number:x}", True)
    rows = view.fields(None, 10.2)
    assert sum(row["car"] == "car2" for row in rows) <= 2 * fleet_cars.MAX_STARTS
    assert len(view._status) == len(view._where) == 1 + fleet_cars.MAX_STARTS
    assert rows[0]["status"]["state"] == "driving"


def test_a_car_that_was_refused_its_name_is_shown():
    view = fleet_cars.FleetView([])
    view._on_refused(deaf_link("tcp/r:1"), "wallride/car1/refused/0c", True)
    (line,) = fleet_cars.table(view.fields(None, 0.0))
    assert "session 0c is refused" in line
    view._on_refused(deaf_link("tcp/r:1"), "wallride/car1/refused/0c", False)
    assert view.fields(None, 0.0) == []


async def test_every_car_is_stopped_and_each_confirms():
    async with beating_car("car1") as (first, _), beating_car("car2", latched=True) as (second, came):
        parsed, said = stop_options("--all", "--connect", f"{first},{second}")
        assert await fleet_stop.run(parsed) == 0
        assert [line.split()[0] for line in said] == ["car1", "car2"]
        assert all("e-stop latched after" in line for line in said)
        assert came, "a car that is latched already is told as well"


async def test_a_car_that_does_not_latch_and_an_endpoint_that_is_away_are_failures(monkeypatch):
    monkeypatch.setattr(fleet_stop, "GIVE_UP_S", 0.8)
    away = free_endpoint()
    async with beating_car("car1", obeys=False) as (first, came), beating_car("car2") as (second, _):
        parsed, said = stop_options("--all", "--connect", f"{first},{second},{away}")
        assert await fleet_stop.run(parsed) == 1
        assert "DOES NOT CONFIRM" in said[0]
        assert "latched" in said[1]
        assert said[2].startswith(f"cars only there were not stopped: {away}")
        assert len(came) > 10, "it is told again and again"


@pytest.mark.parametrize("other", ["tls/127.0.0.1:7648", "tls/[::1]:7648", "http/car2:1", "tcp/car2:99999"])
async def test_an_endpoint_that_can_have_no_session_keeps_no_other_car_driving(other, tmp_path):
    async with beating_car("car1") as (first, came):
        for arguments in (["--all"], []):
            parsed, said = stop_options(*arguments, "--connect", f"{first},{other}", "--keys", str(tmp_path))
            assert await fleet_stop.run(parsed) == 1
            assert "e-stop latched" in said[0]
            assert said[1].startswith("cars only there were not stopped: ")
            assert other in said[1]
        assert came
    parsed, said = stop_options("--all", "--connect", other, "--keys", str(tmp_path))
    assert await fleet_stop.run(parsed) == 1
    assert said[0].startswith("nothing was stopped: ")
    parsed, _ = stop_options("--connect", other, "--keys", str(tmp_path))
    with pytest.raises(ConnectionProblemError, match=f"nothing was stopped: .*{re.escape(other)}"):
        await fleet_stop.run(parsed)


async def test_a_car_whose_name_is_announced_as_a_recording_is_stopped_and_confirms_all_the_same():
    async with beating_car("car1") as (endpoint, _), client_bus(endpoint) as liar:
        liar.announce(topics.key("car1", topics.PLAYED))
        parsed, said = stop_options("--all", "--connect", endpoint)
        assert await fleet_stop.run(parsed) == 0
    assert len(said) == 1
    assert "e-stop latched after" in said[0]


@pytest.mark.parametrize("arguments", [["--all"], ["--car", "car1"], []])
async def test_an_e_stop_that_reaches_nothing_says_that_nothing_was_stopped(arguments, monkeypatch):
    monkeypatch.setattr(fleet_stop, "GIVE_UP_S", 0.8)
    away = free_endpoint()
    parsed, said = stop_options(*arguments, "--connect", away)
    try:
        assert await fleet_stop.run(parsed) == 1
    except ConnectionProblemError as problem:
        said = [str(problem)]
    assert len(said) == 1
    assert said[0].startswith(f"nothing was stopped: cannot connect to {away} (")
    assert "Stop the car by hand" in said[0]


@pytest.mark.parametrize(
    ("obeys", "code", "words"), [(True, 0, "e-stop latched after"), (False, 1, "DOES NOT CONFIRM: stop it by hand")]
)
async def test_of_two_cars_of_one_name_each_has_a_line_and_both_must_confirm(monkeypatch, obeys, code, words):
    monkeypatch.setattr(fleet_stop, "GIVE_UP_S", 0.8)
    async with beating_car("car1", session=1) as (first, _), beating_car("car1", obeys=obeys, session=2) as (second, _):
        parsed, said = stop_options("--all", "--connect", f"{first},{second}")
        assert await fleet_stop.run(parsed) == code
    assert len(said) == 2
    assert said[0].startswith("car1 (session 00000001) e-stop latched after")
    assert said[1].startswith(f"car1 (session 00000002) {words}")


@pytest.mark.parametrize("arguments", [["--all"], []])
async def test_a_car_that_is_refused_its_name_is_named_as_not_stopped(arguments):
    async with beating_car("car1") as (first, _), client_bus(first) as refused:
        refused.announce(topics.key("car1", f"{topics.REFUSED}/0000000c"))
        parsed, said = stop_options(*arguments, "--connect", first)
        began_s = time.monotonic()
        assert await fleet_stop.run(parsed) == 1
    assert time.monotonic() - began_s < fleet_stop.GIVE_UP_S, "what cannot confirm is not waited for"
    assert "e-stop latched" in said[0]
    assert said[1].startswith(f"car1 (session 0000000c) is refused at {first}")
    assert said[1].endswith("was not stopped: stop it by hand")


def test_a_car_that_is_refused_at_one_router_and_stops_by_another_is_stopped():
    refusing, other = deaf_link("tcp/a:1", lambda *_, **__: None), deaf_link("tcp/b:1", lambda *_, **__: None)
    stop = fleet_stop.FleetStop([refusing, other], "me")
    stop._on_refused(refusing, "wallride/car1/refused/00000001", True)
    stop.press(10.0)
    assert stop.cars == {"car1": None}
    stop._on_refused(refusing, "wallride/car1/refused/00000001", False)
    assert stop.cars == {"car1": None}, "out of reach, and perhaps driving"
    stop._on_beat(other, BEAT, beat_of(1, latched=True), 10.1)
    assert stop.cars == {"car1": pytest.approx(0.1)}
    stop.end(1.0)
    stop.press(20.0)
    assert not any(one.refused_at for one in stop.results), "it has left since"


async def test_without_all_the_only_car_is_stopped_and_several_are_named():
    async with beating_car("car1") as (first, one), beating_car("car2") as (second, other):
        parsed, _ = stop_options("--connect", f"{first},{second}")
        with pytest.raises(ConnectionProblemError, match=r"car1, car2.*--all"):
            await fleet_stop.run(parsed)
        assert (one, other) == ([], [])
        parsed, said = stop_options("--connect", first)
        assert await fleet_stop.run(parsed) == 0
        assert "latched" in said[0]
        assert other == []


async def test_a_car_that_appears_while_stop_is_pressed_is_stopped_too():
    sent: list[tuple[str, int]] = []
    links = [deaf_link("tcp/a:1", lambda key, payload, **_: sent.append((key, read_command(payload).sequence)))]
    stop = fleet_stop.FleetStop(links, "me")
    stop.press(time.monotonic())
    assert sent == []
    stop._on_token(links[0], "wallride/late/alive", True)
    stop.step(time.monotonic())
    assert sent == [("wallride/late/operator/command", 1), ("wallride/late/operator/command", 2)]


def beat_of(session, *, latched=False):
    return Beat(session, 1, CarCondition.ESTOP_LATCHED if latched else CarCondition(0)).pack()


BEAT = "wallride/car1/beat"


def test_the_start_of_a_car_that_has_ended_need_not_confirm_what_is_pressed_later():
    link = deaf_link("tcp/a:1", lambda *_, **__: None)
    stop = fleet_stop.FleetStop([link], "me")
    stop._on_beat(link, BEAT, beat_of(1), 10.0)
    stop._on_beat(link, BEAT, beat_of(2), 15.0)
    stop.press(15.5)
    assert stop.cars == {"car1": None}
    stop._on_beat(link, BEAT, beat_of(2, latched=True), 15.6)
    assert stop.cars == {"car1": pytest.approx(0.1)}


def test_a_car_that_leaves_while_stop_is_pressed_or_shortly_before_is_missed_and_one_that_left_long_ago_is_not():
    link = deaf_link("tcp/a:1", lambda *_, **__: None)
    stop = fleet_stop.FleetStop([link], "me")
    for name in ("car1", "car2"):
        stop._on_token(link, f"wallride/{name}/alive", True)
    stop._on_token(link, "wallride/car2/alive", False)
    stop.end(9.0)
    assert stop.left == ["car2"]
    stop.press(10.0)
    stop._on_token(link, "wallride/car1/alive", False)
    assert stop.cars == {"car1": None, "car2": None}, "out of reach, and perhaps driving"
    for now_s in (11.0, 10.0 + fleet_stop.LEFT_S, 12.0 + fleet_stop.LEFT_S):
        stop.end(now_s)
    stop.press(50.0)
    assert (stop.cars, stop.left) == ({}, [])
