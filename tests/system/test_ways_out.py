"""Whatever way out of the process Python can still take, a brake is the last word at the motor's port."""

import os
import signal
import time

import pytest

from tests.system.bench import bench
from tests.system.way_out import WAYS
from wallride.drivers.vesc.codec import Packet
from wallride.runtime.host.stop_signals import STOP_SIGNALS

BRAKE_WITHIN_S = 0.25


async def assert_braked(car, since_s):
    await car.until(lambda: car.runtime.exit_code is not None, "exit", 10.0)
    assert car.first_brake_s(since_s) - since_s < BRAKE_WITHIN_S
    after = [payload[0] for _, payload in car.motor_commands(car.first_brake_s(since_s))]
    assert set(after) == {Packet.SET_CURRENT_BRAKE}


@pytest.mark.parametrize("way", WAYS)
async def test_a_brake_is_the_last_word(tmp_path, monkeypatch, way):
    chosen = tmp_path / "way"
    monkeypatch.setenv("WALLRIDE_WAY_OUT", str(chosen))
    async with bench(tmp_path, program="tests.system.way_out") as car:
        await car.until_driving()
        ready = tmp_path / "way.new"
        ready.write_text(way)
        begun_s = time.monotonic()
        ready.replace(chosen)
        await assert_braked(car, begun_s)
        assert car.runtime.exit_code != 0


@pytest.mark.parametrize("number", [*STOP_SIGNALS], ids=lambda number: number.name)
async def test_a_signal_that_can_be_caught_brings_the_car_to_rest(tmp_path, number):
    async with bench(tmp_path) as car:
        await car.until_driving()
        begun_s = time.monotonic()
        os.kill(car.runtime.pid, number)
        await assert_braked(car, begun_s)
        assert car.runtime.exit_code == 0
        assert car.wheel_mps < 0.1, "it left a rolling car"


def test_every_signal_that_ends_a_process_and_can_be_caught_is_a_stop():
    crashes = {"SIGABRT", "SIGBUS", "SIGFPE", "SIGILL", "SIGSEGV", "SIGSYS", "SIGTRAP"}
    ignored = {"SIGCHLD", "SIGCLD", "SIGURG", "SIGWINCH", "SIGCONT", "SIGTSTP", "SIGTTIN", "SIGTTOU", "SIGPIPE",
               "SIGXFSZ"}  # fmt: skip
    never = {"SIGKILL", "SIGSTOP"}
    rare = {"SIGPOLL", "SIGIO", "SIGPROF", "SIGPWR", "SIGSTKFLT"}
    names = {one.name for one in signal.Signals} - crashes - ignored - never - rare
    assert {name for name in names if not name.startswith("SIGRT")} == {one.name for one in STOP_SIGNALS}
