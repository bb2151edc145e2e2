"""The first wish to end is "time is up", the second one kills; signals are real, processes are none."""

import os
import signal
import sys
from argparse import Namespace
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock

import pytest

from wallride import sim_options
from wallride.sim.live.command import simulate
from wallride.sim.live.record import Record
from wallride.sim.live.session import SessionError, SimulatorSession
from wallride.sim.live.stop_request import StopRequest


def send(number):
    os.kill(os.getpid(), number)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_first_signal_asks_and_nothing_more(number):
    stop = StopRequest()
    before = signal.getsignal(number)
    with stop.listening():
        told = [(stop.asked, stop.killed)]
        send(number)
        told.append((stop.asked, stop.killed))
    assert told == [(False, False), (True, False)]
    assert signal.getsignal(number) is before


def test_the_second_kills_what_drives_and_interrupts_nothing():
    stop, killed = StopRequest(), []
    with stop.listening(), stop.killing(lambda: killed.append("runtime")):
        send(signal.SIGINT)
        assert killed == []
        send(signal.SIGINT)
        assert killed == ["runtime"]
        assert stop.killed
        with pytest.raises(KeyboardInterrupt):
            send(signal.SIGINT)


def test_where_nothing_drives_the_second_interrupts():
    stop = StopRequest()
    with stop.listening():
        send(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            send(signal.SIGINT)


def test_asking_twice_by_a_key_is_no_kill():
    stop = StopRequest()
    stop.ask()
    stop.ask()
    assert stop.asked
    assert not stop.killed


def test_before_anything_drives_the_first_signal_ends_what_is_being_loaded():
    stop = StopRequest()
    with stop.listening(), pytest.raises(KeyboardInterrupt), stop.loading():
        send(signal.SIGTERM)
    assert stop.asked


async def test_a_stop_while_the_car_starts_waits_for_nothing(tmp_path):
    stop = StopRequest()
    session: Any = SimpleNamespace(record=Record())
    stop.ask()
    emulator: Any = SimpleNamespace(streaming=False)
    process: Any = SimpleNamespace(exit_code=None, log=["starts", "lidar faulty: bugs:Ends ended its run"])
    with pytest.raises(SessionError, match=r"before the car had started; .*; lidar faulty: bugs:Ends ended its run"):
        await SimulatorSession._until_up(session, emulator, process, tmp_path / "address", lambda _record: None, stop)


async def test_a_lidar_that_is_never_asked_for_scans_ends_the_drive_with_the_reason(tmp_path, monkeypatch):
    """A driver of the user's that ends, or only sleeps, is not waited for as long as the first start."""
    monkeypatch.setattr("wallride.sim.live.session.ASKED_WITHIN_S", 0.0)
    monkeypatch.setattr("wallride.sim.live.session.read_address", lambda _file: "known")
    session: Any = SimpleNamespace(record=Record())
    emulator: Any = SimpleNamespace(streaming=False)
    process: Any = SimpleNamespace(exit_code=None, log=["lidar faulty: bugs:Ends ended its run"], stop=AsyncMock())
    with pytest.raises(SessionError, match=r"^the lidar sends nothing; lidar faulty: bugs:Ends ended its run$"):
        await SimulatorSession._until_up(
            session, emulator, process, tmp_path / "address", lambda _record: None, StopRequest()
        )
    process.stop.assert_awaited_once()


def test_a_simulator_that_is_still_imported_ends_at_once(monkeypatch):
    module = ModuleType("wallride.sim.live.command")
    module.__getattr__ = lambda _name: send(signal.SIGINT)  # type: ignore[method-assign]
    monkeypatch.setitem(sys.modules, "wallride.sim.live.command", module)
    with pytest.raises(KeyboardInterrupt):
        sim_options.run(Namespace())


def test_a_simulation_that_still_reads_its_settings_ends_at_once(monkeypatch):
    monkeypatch.setattr("wallride.sim.live.command.find_config", lambda: send(signal.SIGINT))
    stop = StopRequest()
    with stop.listening(), pytest.raises(KeyboardInterrupt):
        simulate(Namespace(config=None, race=None, json=None), stop)
