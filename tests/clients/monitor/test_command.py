"""The command itself: what it prints, and what it says when it cannot."""

import asyncio
import contextlib
import os
import signal
import socket

import pytest
import segno

from tests.typed import typed
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.fleet import links
from wallride.clients.monitor import server
from wallride.clients.monitor.server import qr_lines


def options(*arguments):
    found = typed("monitor", *arguments)
    found.name = "ann"
    return found


@contextlib.asynccontextmanager
async def running(*arguments, until=bool):
    """Run the command until it has said enough, and yield that; then end it by a signal, in good order."""
    asked, said = options("--port", "0", *arguments), []
    asked.print_line = said.append
    task = asyncio.create_task(server.run(asked))
    async with asyncio.timeout(5):
        while not until(said):
            await asyncio.sleep(0.01)
    yield said
    os.kill(os.getpid(), signal.SIGTERM)
    async with asyncio.timeout(5):
        assert await task == 0


async def test_it_prints_its_address_and_ends_in_good_order(scene):
    async with running("--no-browser", "--connect", scene.endpoint) as said:
        assert said[0].startswith("the monitor is at http://127.0.0.1:")


@pytest.mark.parametrize(
    ("address", "port", "words"),
    [
        ("192.0.2.1", "0", "this computer has no such address; choose one of its own with --host, or 0.0.0.0 for all"),
        ("nowhere.invalid", "0", "choose another with --host"),
        ("127.0.0.1", "TAKEN", "it is taken by another program; choose another with --port"),
    ],
)
async def test_what_cannot_be_listened_on_names_the_option_that_is_wrong(address, port, words):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1]) if port == "TAKEN" else port
        with pytest.raises(ConnectionProblemError, match=f"^cannot listen on {address}:{port}: .*{words}$"):
            await server.run(options("--no-browser", "--host", address, "--port", port))


async def test_without_a_car_it_says_what_it_waits_for(monkeypatch, capfd):
    monkeypatch.setattr(links, "TOLD_AFTER_S", 0.1)
    told = []

    def is_told(_said):
        told.append(capfd.readouterr().err)
        return "wallride: No car at tcp/127.0.0.1:1. Start one: make sim here" in "".join(told)

    async with running("--no-browser", "--connect", "tcp/127.0.0.1:1", until=is_told):
        pass


@pytest.mark.parametrize(("further", "view"), [([], "#all"), (["--car", "car1"], "")])
async def test_with_several_endpoints_its_address_opens_all_cars(scene, further, view):
    async with running("--no-browser", "--connect", f"{scene.endpoint},tcp/127.0.0.1:1", *further) as said:
        assert said[0].partition("token=")[2].partition("#")[1:] == (view[:1], view[1:])


async def test_for_others_it_prints_the_address_as_a_code_too(scene):
    wide = ("--no-browser", "--host", "0.0.0.0", "--connect", scene.endpoint)
    async with running(*wide, until=lambda said: len(said) >= 3) as said:
        address = said[0].removeprefix("the monitor is at ")
        assert "token=" in address
        assert said[2] == qr_lines(address)


def test_the_code_holds_the_whole_address():
    """Read back from the half blocks: the modules are those of a code of this address and of no other."""
    address = "http://192.168.1.23:8447/?token=abcdefghijklmnop"
    lines = qr_lines(address, "utf-8").splitlines()
    rows = []
    for line in lines:
        rows.append([block in "█▀" for block in line])
        rows.append([block in "█▄" for block in line])
    light = [[not module for module in row] for row in rows]
    for text, is_same in ((address, True), (f"{address}x", False)):
        code = segno.make(text, error="l", micro=False)
        wanted = [[bool(module) for module in row] for row in code.matrix_iter(border=2)]
        assert (light[: len(wanted)] == wanted) is is_same


def test_a_terminal_without_blocks_gets_no_code():
    assert qr_lines("http://127.0.0.1/", "ascii") == ""


async def test_a_taken_port_is_said_and_the_default_one_is_replaced(scene):
    async with scene.monitor():
        taken = str(scene.port)
        with pytest.raises(ConnectionProblemError, match=f"{taken}.*--port"):
            await server.run(options("--no-browser", "--port", taken, "--connect", scene.endpoint))


def test_several_cars_are_several_endpoints():
    found = server.places(options("--connect", "tcp/127.0.0.1:7447, 127.0.0.1:7448"))
    assert [place.endpoint for place in found] == ["tcp/127.0.0.1:7447", "tcp/127.0.0.1:7448"]
    with pytest.raises(ConnectionProblemError, match="--connect"):
        server.places(options("--connect", ","))


@pytest.mark.parametrize("wrong", [("--port", "70000"), ("--max-speed", "99"), ("--max-steering", "2")])
def test_impossible_options_are_refused(wrong):
    with pytest.raises(SystemExit):
        options(*wrong)
