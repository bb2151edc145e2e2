"""The client against a car on a real session on loopback, and as a process that is told to end."""

import asyncio
import contextlib
import io
import os
import pty
import signal
import subprocess
import sys
import time

import pytest

from tests.clients.speaking_car import CarSession, client_bus
from tests.clients.teleop.scenes import LINEAR, SESSION
from tests.promises import promise
from tests.waiting import until
from wallride.clients.teleop.app import Client, deadlines
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.pilot import Pilot
from wallride.clients.teleop.screen import Screen
from wallride.clients.teleop.script import Script, Step
from wallride.clients.teleop.sources import ScriptSource
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import BYTES
from wallride.runtime.wire.teleop import Beat, CarCondition, Input, Press, read_command

MANUAL = frozenset({Control.MANUAL})
LAP = Script([
    Step(0.0, frozenset()), Step(0.1, MANUAL), Step(0.2, MANUAL, 0.5, -0.5), Step(0.5, frozenset()),
    Step(0.6, frozenset()),
])  # fmt: skip


class FakeCar(CarSession):
    """Beats, and remembers what it was told. obeys: by its heartbeats, the newest command's session and each e-stop."""

    def __init__(self, *, obeys=True):
        super().__init__()
        self.obeys = obeys
        self.commands = []
        self.beating = True

    def serve(self):
        self.bus.subscribe(topics.key("car1", topics.COMMAND), self._receive)
        self._task = asyncio.create_task(self._beat())

    async def __aexit__(self, *_):
        self._task.cancel()
        await super().__aexit__()

    def _receive(self, _key, payload, arrival_s):
        self.commands.append((arrival_s, read_command(payload)))

    async def _beat(self):
        number = 0
        while True:
            number += 1
            newest = self.commands[-1] if self.commands and self.obeys else None
            sequence, age_ms = (newest[1].sequence, round((time.monotonic() - newest[0]) * 1000)) if newest else (0, 0)
            session = newest[1].session if newest else 0
            stopped = self.obeys and Press.ESTOP in self.flags
            conditions = CarCondition.ESTOP_LATCHED if stopped else CarCondition(0)
            beat = Beat(4, number, conditions, session, sequence, age_ms, 0.0, "ann")
            if self.beating:
                self.bus.put(topics.key("car1", topics.BEAT), beat.pack(), encoding=BYTES, urgent=True)
            await asyncio.sleep(0.02)

    @property
    def flags(self):
        return [command.flags for _, command in self.commands]

    async def heard(self, flags):
        await until(lambda: flags in self.flags)


@contextlib.asynccontextmanager
async def client_of(car, script, out, session=None):
    """Yield a client with its session, and its pilot."""
    async with client_bus(car.endpoint) as bus:
        pilot, screen = Pilot(SESSION, "ann", LINEAR), Screen(out, plain=True)
        yield Client(bus, "car1", pilot, ScriptSource(script), screen, time.monotonic, session), pilot


async def test_a_script_drives_a_car_on_loopback_and_says_goodbye():
    out = io.StringIO()
    async with FakeCar() as car, client_of(car, LAP, out) as (client, pilot):
        await client.run(asyncio.Event())
        await car.heard(Press.GOODBYE)
    driving = [command for _, command in car.commands if command.flags == Press.MANUAL]
    assert 15 <= len(driving) <= 21
    assert (driving[-1].speed_mps, driving[-1].steering_rad) == (1.0, pytest.approx(-0.2))
    assert driving[0].speed_mps == 0, "the deadman first"
    assert all(command.beat > 0 and command.car_session == 4 for command in driving)
    assert set(car.flags) == {Press(0), Press.MANUAL, Press.GOODBYE}
    assert car.flags[-1] is Press.GOODBYE, "one of three may be held back, so soon after a command"
    sequences = [command.sequence for _, command in car.commands]
    assert sequences == sorted(set(sequences))
    assert pilot.situation.round_trip_s >= 0
    assert "DRIVING" in out.getvalue()
    promise("a round trip", pilot.situation.round_trip_s, 0.2)


async def test_another_start_of_the_car_is_not_driven():
    async with FakeCar() as car, client_of(car, LAP, io.StringIO(), session=5) as (client, _), asyncio.timeout(10):
        await client.run(asyncio.Event())
    assert client.foreign == 4
    assert Press.MANUAL not in car.flags


async def test_a_car_that_falls_silent_is_noticed_and_its_return_moves_nothing():
    out = io.StringIO()
    held = Script([Step(0.0, frozenset()), Step(0.1, MANUAL), Step(0.2, MANUAL, 1.0), Step(60.0, frozenset())])

    async def said(words):
        await until(lambda: words in out.getvalue())

    async with FakeCar() as car, client_of(car, held, out) as (client, _):
        stop = asyncio.Event()
        running = asyncio.create_task(client.run(stop))
        await car.heard(Press.MANUAL)
        car.beating = False
        silent_s = time.monotonic()
        await said("LINK LOST")
        noticed_s = time.monotonic() - silent_s
        car.commands.clear()
        car.beating = True
        await said("release first")
        stop.set()
        await running
    assert noticed_s > 0.1
    assert Press.MANUAL not in car.flags
    promise("seeing a lost link", noticed_s, 0.3)


async def test_a_closed_terminal_is_a_goodbye():
    class Closed(io.StringIO):
        def write(self, _text):
            raise OSError("gone")

    async with FakeCar() as car, client_of(car, LAP, Closed()) as (client, _):
        await client.run(asyncio.Event())
        await car.heard(Press.GOODBYE)
    assert set(car.flags) <= {Press(0), Press.GOODBYE}


async def test_deadlines_are_absolute_and_missed_ones_are_left_out():
    now_s, seen = time.monotonic(), []
    offset_s = 0.0

    def clock():
        return time.monotonic() + offset_s

    async for at_s in deadlines(0.005, clock):
        seen.append(at_s - now_s)
        if len(seen) == 3:
            offset_s = 1.0
        if len(seen) == 6:
            break
    assert seen[3] >= 1.0
    assert seen[5] - seen[3] >= 0.004, "no burst afterwards"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
async def test_a_process_that_is_told_to_end_says_goodbye(tmp_path, number):
    script = tmp_path / "hold.csv"
    script.write_text("time_s,buttons,speed\n0,,0\n0.1,LB,0\n0.2,LB,1\n60,,0\n")
    program = (
        "import argparse, sys\nfrom wallride import teleop_options\nparser = argparse.ArgumentParser()\n"
        "teleop_options.add(parser.add_subparsers())\noptions = parser.parse_args()\nsys.exit(options.run(options))"
    )
    async with FakeCar() as car:
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", program, "teleop", "--connect", car.bus.endpoint, "--script", str(script),
            stdout=subprocess.PIPE,
        )  # fmt: skip
        await car.heard(Press.MANUAL)
        process.send_signal(number)
        async with asyncio.timeout(10):
            out, _ = await process.communicate()
        await car.heard(Press.GOODBYE)
    assert process.returncode == 0
    assert car.flags[-1] is Press.GOODBYE, "one of three may be held back, so soon after a command"
    assert b"ready" in out


TYPED = {"space": b" ", "escape": b"\x1b"}


@pytest.mark.parametrize("name", TYPED)
async def test_in_a_terminal_without_a_gamepad_the_keyboard_drives_and_stops(name):
    async with FakeCar() as car:
        child, terminal = pty.fork()
        if child == 0:  # SDL finds no pad: it is told to look for none
            os.environ |= {"TERM": "xterm", "SDL_VIDEODRIVER": "dummy", "SDL_JOYSTICK_DISABLE_UDEV": "1"}
            os.execv(sys.executable, [sys.executable, "-m", "wallride", "teleop", "--connect", car.bus.endpoint])  # noqa: S606
        os.set_blocking(terminal, False)

        async def typed_until(key, flags):
            async with asyncio.timeout(20):
                while flags not in car.flags:
                    os.write(terminal, key)
                    with contextlib.suppress(BlockingIOError):
                        os.read(terminal, 1 << 16)
                    await asyncio.sleep(0.04)

        try:
            await typed_until(b"", Press(0))
            await typed_until(b"w", Press.MANUAL)
            driving = [command for _, command in car.commands if command.flags == Press.MANUAL]
            assert all(command.input is Input.KEYBOARD for command in driving)
            os.write(terminal, TYPED[name])
            await typed_until(b"", Press.ESTOP)
            assert max(command.speed_mps for _, command in car.commands) <= 0.75
        finally:
            os.kill(child, signal.SIGTERM)
            with contextlib.suppress(OSError):
                while os.read(terminal, 1 << 16):
                    pass
            await asyncio.to_thread(os.waitpid, child, 0)
            os.close(terminal)
