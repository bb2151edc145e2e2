"""An endpoint at which no car is heard: `wallride cars`, `stop` and `race` say why, as `wallride status` does."""

import asyncio
import time
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from tests.typed import telling
from wallride.cli import build_parser
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.fleet import cars as fleet_cars
from wallride.clients.fleet import links, race_command
from wallride.clients.fleet import stop as fleet_stop
from wallride.clients.fleet.links import FleetLink
from wallride.clients.keys.folder import KeyFolder
from wallride.clients.refreshing import RefreshedScreen
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.zenoh_config import Person, Role, Tls, car_config, client_config

stop_options = partial(telling, "stop")


@asynccontextmanager
async def guarded_car(tmp_path, *people):
    """A car that lists these people; yields the options for eve, whose keys are its own, at its encrypted endpoint."""
    now = datetime.now(UTC)
    folder = KeyFolder(tmp_path / "car")
    folder.begin("mc1", ["localhost"], now, 30, renew=False)
    folder.add(Person("eve", Role.OPERATOR), tmp_path / "eve", now, 30, renew=False)
    endpoint = free_endpoint().replace("tcp/127.0.0.1", "tls/localhost")
    tls = Tls(*(folder.path / name for name in ("ca.pem", "car.pem", "car.key")))
    bus = Bus(car_config([endpoint], tls, people, "mc1"))
    bus.announce(topics.key("mc1", topics.ALIVE))
    await bus.open()
    try:
        yield ["--connect", endpoint, "--keys", str(tmp_path / "eve")]
    finally:
        await bus.close()


async def test_keys_that_the_car_does_not_list_are_said_and_listed_ones_are_no_reason(tmp_path):
    async with guarded_car(tmp_path) as place:
        parsed, said = telling("cars", *place)
        assert await fleet_cars.run(parsed) == 1
        (line,) = said
        assert line.startswith(f"{place[1]} let eve in and says nothing: eve is revoked or not listed there")
        for arguments in (["--all"], []):
            parsed, said = stop_options(*arguments, *place)
            try:
                await fleet_stop.run(parsed)
            except ConnectionProblemError as problem:
                said = [str(problem)]
            (line,) = said
            assert line.startswith(f"nothing was stopped: {place[1]} let eve in and says nothing: eve is revoked")
            assert "Stop the car by hand" in line
    async with guarded_car(tmp_path / "b", Person("eve", Role.OPERATOR)) as place:
        parsed, said = telling("cars", *place)
        assert await fleet_cars.run(parsed) == 0
        (line,) = said
        assert "says nothing" in line, "of a car that is there and has no status"
        assert "revoked" not in line


async def test_a_screen_says_of_which_endpoint_nothing_is_heard(tmp_path, monkeypatch, capsys):
    shown: list[str] = []
    monkeypatch.setattr(RefreshedScreen, "show", lambda _self, text, _plain: shown.append(text))
    async with guarded_car(tmp_path) as place:
        parsed, _ = telling("cars", "--watch", *place)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(links.TOLD_AFTER_S + 0.5):
                await fleet_cars.run(parsed)
    for told in (shown[-1], capsys.readouterr().err):
        assert f"{place[1]} let eve in and says nothing: eve is revoked" in told
    assert "revoked" not in shown[0], "it has just begun to connect"


async def test_a_car_of_other_keys_is_said_as_status_says_it(tmp_path):
    async with guarded_car(tmp_path / "a") as place, guarded_car(tmp_path / "b") as foreign:
        for command, begins in (["cars"], ""), (["stop", "--all"], "nothing was stopped: "):
            parsed, said = telling(*command, *place[:2], *foreign[2:])
            assert await (fleet_cars if command == ["cars"] else fleet_stop).run(parsed) == 1
            (line,) = said
            assert line.startswith(f"{begins}{place[1]}: is not the car that your keys are for")


def test_an_endpoint_whose_car_has_left_is_not_said_to_refuse_the_keys():
    keys: Any = SimpleNamespace(identity=SimpleNamespace(name="eve"))
    link = FleetLink(Bus(client_config("tcp/127.0.0.1:1", None)), "", keys, time.monotonic())
    assert links.unheard([link]) == [], "it opened just now"
    link.opened_s -= links.QUIET_S
    assert len(links.unheard([link])) == 1
    links._on_token(link, "wallride/car1/alive", True)
    links._on_token(link, "wallride/car1/alive", False)
    assert links.unheard([link]) == []


@pytest.mark.parametrize("command", [["race"], ["race", "--json"], ["cars", "--watch"]])
async def test_a_screen_into_a_pipe_says_on_standard_error_what_it_waits_for(command, monkeypatch, capsys):
    monkeypatch.setattr(links, "TOLD_AFTER_S", 0.05)
    parsed = build_parser().parse_args([*command, "--connect", "tcp/127.0.0.1:1"])
    parsed.print_line = lambda _line: None
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.5):
            await (race_command if command[0] == "race" else fleet_cars).run(parsed)
    assert capsys.readouterr().err.startswith("wallride: waiting for a car: tcp/127.0.0.1:1: ")
