"""A screen is a screen on a terminal; a pipe or a file gets a line a second that a person and grep can read."""

import asyncio
import contextlib
from typing import Any

import pytest

from tests.clients.speaking_car import speaking_car
from tests.waiting import until
from wallride.cli import build_parser
from wallride.clients import plot, status
from wallride.clients.fleet import cars
from wallride.clients.refreshing import RefreshedScreen
from wallride.runtime.host.terminal_text import CLEAR_SCREEN


def test_a_terminal_is_drawn_anew_each_time():
    said: list[str] = []
    screen = RefreshedScreen(said.append, is_terminal=True, clock=lambda: 0.0)
    screen.show("a\nb", "line")
    screen.show("c\nd", "line")
    assert said == [f"{CLEAR_SCREEN}a\nb", f"{CLEAR_SCREEN}c\nd"]


def test_a_pipe_gets_a_line_a_second():
    said: list[str] = []
    now_s = 0.0
    screen = RefreshedScreen(said.append, is_terminal=False, clock=lambda: now_s)
    for step in range(25):
        now_s = 0.1 * step
        screen.show("a\nb", f"at {now_s:.1f}")
    assert said == ["at 0.0", "at 1.0", "at 2.0"]


@pytest.mark.parametrize(
    ("program", "arguments", "words"),
    [
        (status.run, ("status", "--watch"), "car1  drives 1.00 m/s"),
        (cars.run, ("cars", "--watch"), "car1"),
        (plot.run, ("plot", "distance_error"), "distance_error:data"),
    ],
)
async def test_no_watching_command_writes_codes_of_a_terminal_into_a_pipe(program, arguments, words, monkeypatch):
    monkeypatch.setattr("wallride.clients.refreshing.LINE_EVERY_S", 0.3)
    monkeypatch.setattr("sys.stdout.isatty", lambda: False, raising=False)
    said: list[str] = []
    async with speaking_car() as car:
        parsed: Any = build_parser().parse_args([*arguments, "--connect", car.endpoint])
        parsed.print_line = said.append
        watching = asyncio.create_task(program(parsed))
        await until(lambda: any(words in line for line in said[1:]), 15)
        watching.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await watching
    assert not any("\x1b" in line or "\n" in line for line in said)
