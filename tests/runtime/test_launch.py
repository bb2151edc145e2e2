"""The last brake: an event loop that ends without its tasks' `finally` must not leave a driving car."""

import asyncio
import runpy
import signal
import subprocess
import sys
import threading
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.promises import promise
from tests.runtime.recording.drives import Drive
from wallride.runtime import launch
from wallride.runtime.host import logging_setup
from wallride.runtime.host.side_work import SideWork
from wallride.runtime.recording import recorder
from wallride.runtime.settings.tree import Settings
from wallride.sim.virtual.virtual_time import run_virtual


class BrakedMotor:
    def __init__(self):
        self.brakes = 0

    def brake_now(self):
        self.brakes += 1


@pytest.fixture(autouse=True)
def no_end(monkeypatch):
    """Let the timer that ends the process end nothing here."""
    monkeypatch.setattr("os._exit", lambda _code: None)


def test_a_loop_that_breaks_is_followed_by_a_brake():
    motor = BrakedMotor()

    async def drive():
        loop = asyncio.get_running_loop()

        def broken(_timeout):
            raise ValueError("filedescriptor out of range in select()")

        vars(loop)["_selector"].select = broken
        await asyncio.sleep(1)

    with (
        pytest.raises(ValueError, match="out of range"),
        launch.braking_last([motor]),
        asyncio.Runner(loop_factory=launch.PunctualLoop) as runner,
        launch.braking_last([motor]),
    ):
        runner.run(drive())
    assert motor.brakes >= 1


@pytest.mark.parametrize("error", [launch.LaunchError, SystemExit, KeyboardInterrupt, MemoryError, None])
def test_every_error_and_a_good_end_are_followed_by_a_brake(error):
    motor = BrakedMotor()
    with pytest.raises(error) if error else nullcontext(), launch.braking_last([motor]):
        if error:
            raise error
    assert motor.brakes == 1


@pytest.mark.parametrize("words", ["no zenoh here", "a panic in another language"])
async def test_a_session_that_fails_in_any_way_is_said_at_once(words, caplog):
    async def fail():
        raise RuntimeError(words)

    bus: Any = SimpleNamespace(open=fail)
    car: Any = SimpleNamespace(settings=Settings(), session=1, connect=lambda: None)
    await launch._open(car, bus, asyncio.Event(), None)
    assert f"driving without telemetry: {words}" in caplog.text


async def test_the_recorder_is_closed_also_when_the_session_cannot_be():
    async def fail():
        raise RuntimeError("a panic in another language")

    closed = []
    bus: Any = SimpleNamespace(close=fail)
    opening = asyncio.create_task(asyncio.sleep(0))
    with pytest.raises(RuntimeError, match="panic"):
        await launch._close(opening, bus, lambda: closed.append("recorder"), asyncio.Event())
    assert closed == ["recorder"]


def test_a_stop_ends_the_wait_for_a_session_that_does_not_open():
    async def car():
        loop, stop, closed = asyncio.get_running_loop(), asyncio.Event(), []

        async def close():
            closed.append("session")

        opening = asyncio.create_task(asyncio.sleep(60))
        loop.call_later(0.5, stop.set)
        await launch._hold(opening, stop)
        held_s = loop.time()
        bus: Any = SimpleNamespace(close=close)
        await launch._close(opening, bus, lambda: closed.append("recorder"), stop)
        return held_s, loop.time() - held_s, closed, opening.cancelled()

    assert run_virtual(car()) == (0.5, pytest.approx(launch.LEFT_AFTER_S), ["session", "recorder"], True)


@pytest.mark.parametrize(
    ("memory", "code"), [("", 1), ("threading.Thread.start = no_thread", -signal.SIGALRM)], ids=["", "no memory"]
)
def test_a_process_whose_end_hangs_is_ended(memory, code):
    program = f"""
import threading, time
from wallride.runtime import launch
from wallride.runtime.host import ending
def no_thread(_):
    raise RuntimeError("can't start new thread")
ending.MAX_ENDING_S = 0.2
threading.Thread(target=time.sleep, args=(60,)).start()
{memory}
with launch.braking_last([]):
    raise ValueError("broken")
"""
    begun_s = time.monotonic()
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False, timeout=50)
    assert ended.returncode == code
    promise("ending a process that hangs, its start included", time.monotonic() - begun_s, 5.0)


def test_every_thread_of_python_asks_for_precedence_first(tmp_path, monkeypatch):
    """One that is kept from the processor while it holds the interpreter's lock holds up the thread that drives."""
    asked = []
    for module in (launch, logging_setup, recorder):
        monkeypatch.setattr(module, "ask_for_precedence", lambda: asked.append(threading.current_thread().name))
    with logging_setup.journal("INFO", "text"), asyncio.Runner(loop_factory=launch.PunctualLoop) as runner:
        runner.run(asyncio.to_thread(time.monotonic))
    of_drives = Drive(tmp_path).recorder
    of_drives.start()
    of_drives.close()
    assert [name.partition("_")[0] for name in asked[1:]] == ["asyncio", "recorder"]
    assert "_monitor" in asked[0], "the log's"


def test_the_loop_ends_without_one_more_thread(monkeypatch):
    """There may be no memory for it: the start of a thread wants some."""

    def no_thread(_thread):
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch, asyncio.Runner(loop_factory=launch.PunctualLoop) as runner:
        runner.run(asyncio.to_thread(time.monotonic))
        patch.setattr(threading.Thread, "start", no_thread)


async def test_a_drive_without_memory_ends_with_a_sentence(caplog):
    async def follow():
        raise MemoryError

    async def drive():
        async with asyncio.TaskGroup() as devices, asyncio.TaskGroup() as tasks:
            devices.create_task(asyncio.sleep(60))
            tasks.create_task(follow())

    with pytest.raises(SystemExit) as ended, launch.ending_without_memory():
        await drive()
    assert ended.value.code == 1
    assert "out of memory (test_launch.py:" in caplog.text


def test_an_error_beside_the_want_of_memory_is_shown_whole():
    with pytest.raises(ExceptionGroup), launch.ending_without_memory():
        raise ExceptionGroup("", [MemoryError(), ValueError()])


def test_learning_without_memory_ends_the_drive_before_the_interpreter_crashes():
    def learn():
        raise MemoryError

    side_work = SideWork(lambda: 0.0)
    with pytest.raises(SystemExit), launch.ending_without_memory():
        side_work.guarded("learning", learn)()
    assert side_work.words == ()


async def test_a_file_or_telemetry_without_memory_ends_the_drive_in_order_as_well():
    async def write():
        raise MemoryError

    with pytest.raises(SystemExit), launch.ending_without_memory():
        await SideWork(lambda: 0.0).keep("telemetry", write)


@pytest.mark.parametrize("files", [(), (Path("my_laws.py"),)])
def test_threads_of_the_user_leave_the_interpreter_to_the_loop_ten_times_as_soon(files, monkeypatch):
    taken_s = []

    def begun(*_):
        raise launch.LaunchError

    monkeypatch.setattr(launch, "keep_for_this_thread", lambda: "")
    monkeypatch.setattr(launch, "loaded_files", lambda: files)
    monkeypatch.setattr(launch, "loaded_driver_files", lambda: ())
    monkeypatch.setattr(launch, "journal", begun)
    monkeypatch.setattr("numpy.setbufsize", lambda _numbers: None)
    monkeypatch.setattr(sys, "setswitchinterval", taken_s.append)
    with pytest.raises(launch.LaunchError):
        launch.main(Settings(), launch.Files(), launch.Sessions({}), ())
    assert taken_s == [sys.getswitchinterval() / 10] * len(files)


def test_code_of_the_user_cannot_replace_the_handler_of_a_signal_that_stops():
    async def replace():
        loop = asyncio.get_running_loop()
        with pytest.raises(RuntimeError, match=f"signal {signal.SIGTERM:d} stops the car"):
            loop.add_signal_handler(signal.SIGTERM, lambda: None)
        loop.add_signal_handler(signal.SIGWINCH, lambda: None)
        return loop.remove_signal_handler(signal.SIGWINCH)

    with asyncio.Runner(loop_factory=launch.PunctualLoop) as runner:
        assert runner.run(replace())


@pytest.mark.parametrize("raised", ["SystemExit(0)", "KeyboardInterrupt()"])
def test_an_own_driver_that_ends_the_loop_in_a_callback_is_told_with_its_line(tmp_path, monkeypatch, caplog, raised):
    """Else `sys.exit()` in what takes the bytes of a port looks like a wanted end."""
    file = tmp_path / "my_lidar.py"
    file.write_text(f"def on_bytes():\n    raise {raised}\n")
    names = runpy.run_path(str(file))
    monkeypatch.setattr(launch, "loaded_driver_files", lambda: (file,))
    monkeypatch.setattr(launch, "is_of_the_process", lambda _error: False)  # as where signals are held
    motor = BrakedMotor()

    async def drive():
        asyncio.get_running_loop().call_soon(names["on_bytes"])
        await asyncio.sleep(60)

    with (
        pytest.raises(SystemExit) as ended,
        launch.ending_with_its_line(),
        launch.braking_last([motor]),
        asyncio.Runner(loop_factory=launch.PunctualLoop) as runner,
    ):
        runner.run(drive())
    assert ended.value.code == 1
    assert motor.brakes == 1
    assert f"my_lidar.py:2 raised {raised.partition('(')[0]}" in caplog.text


def test_an_end_that_is_not_of_an_own_driver_stays_as_it_is():
    with pytest.raises(SystemExit) as ended, launch.ending_with_its_line():
        raise SystemExit(2)
    assert ended.value.code == 2
