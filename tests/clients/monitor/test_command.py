"""The command itself: what it prints, and what it says when it cannot."""

import argparse
import asyncio
import os
import signal

import pytest

from clients.connection import ConnectionProblemError
from clients.monitor import server
from wallride import monitor_options


def options(*arguments):
    parser = argparse.ArgumentParser()
    monitor_options.add(parser.add_subparsers())
    found = parser.parse_args(["monitor", *arguments])
    found.name = "ann"
    return found


async def test_it_prints_its_address_and_ends_in_good_order(scene):
    said = []
    asked = options("--no-browser", "--port", "0", "--connect", scene.endpoint)
    asked.say = said.append
    running = asyncio.create_task(server.run(asked))
    async with asyncio.timeout(5):
        while not said:
            await asyncio.sleep(0.01)
    assert said[0].startswith("the monitor is at http://127.0.0.1:")
    os.kill(os.getpid(), signal.SIGTERM)
    async with asyncio.timeout(5):
        assert await running == 0


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
