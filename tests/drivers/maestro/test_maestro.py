"""Maestro: golden bytes, its serial timeout, and every loss of it stops the car with its reason."""

import asyncio

import pytest

from tests.waiting import until
from wallride.drivers.api import Drive, LinkState
from wallride.drivers.maestro import codec
from wallride.drivers.maestro.driver import Maestro
from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pwm.driver import UNGUARDED_MPS
from wallride.drivers.pwm.speed import EstimatedSpeed
from wallride.runtime.ending import end
from wallride.sim.devices.esc import EmulatedEsc, EscModel
from wallride.sim.devices.maestro import MaestroEmulator


def test_bytes_are_those_of_the_guide():
    assert codec.set_target(2, 1500.0) == bytes((0x84, 0x02, 0x70, 0x2E))
    assert codec.question(5) == bytes((0x90, 0x05, 0xA1))
    assert codec.decode_answer(bytes((0x70, 0x17, 0x20, 0x00))) == (6000, codec.SERIAL_TIMEOUT)


@pytest.mark.parametrize("answer", [b"", bytes(3), bytes(5), bytes((0x70, 0x17, 0x00, 0xFF))])
def test_other_bytes_are_no_answer(answer):
    assert codec.decode_answer(answer) is None


class Rig:
    def __init__(self, folder, **board):
        self.clock = asyncio.get_running_loop().time
        self.esc = EmulatedEsc(EscModel(armed_after_s=0.1))
        self.board = MaestroEmulator(self.esc, clock=self.clock, **board)
        self.board.start_serial(folder / "maestro")
        self.driver = Maestro(MaestroSettings(address=f"serial://{folder / 'maestro'}", arming_s=0.2), clock=self.clock)
        self.task = asyncio.create_task(self.driver.run())

    async def driving(self):
        await until(lambda: self.driver.health.link is LinkState.READY)
        for _ in range(70):
            self.driver.learn(EstimatedSpeed(self.clock(), self.esc.speed_mps or 0.0, 0.05))
            self.driver.send(Drive(1.0, 0.1))
            await asyncio.sleep(0.01)

    async def close(self):
        await end(self.task)
        self.board.close()


@pytest.fixture
async def rig(request, tmp_path):
    made = Rig(tmp_path, **getattr(request, "param", {}))
    yield made
    await made.close()


async def test_its_timeout_is_found_and_stops_a_car_that_nothing_commands(rig):
    await rig.driving()
    assert rig.driver.max_speed_mps == MaestroSettings().max_speed_mps
    assert rig.driver.words[0] == "the motor allows 2.0 m/s: motor.max_speed_mps"
    assert rig.esc.speed_mps is not None
    silent_s = rig.clock()
    await until(lambda: rig.board.demand(rig.clock()).kind == "coast")
    assert rig.clock() - silent_s < 1.5 * rig.board.timeout_s, "the driver's questions do not feed it"
    await until(lambda: rig.driver.state.timed_out)


@pytest.mark.parametrize("rig", [{"timeout_s": 0.0}], indirect=True)
async def test_without_a_timeout_it_is_slow_and_says_so(rig):
    await rig.driving()
    assert rig.driver.max_speed_mps == UNGUARDED_MPS
    assert "no command timeout" in rig.driver.words[0]


async def test_a_timeout_that_ends_in_a_driving_pulse_is_none(rig):
    rig.board.home_us = 1420.0  # set for another ESC; this one drives backward from 1450 on
    await rig.driving()
    assert rig.driver.max_speed_mps == UNGUARDED_MPS
    assert "its board's timeout goes to 1420 us, which drives (neutral is 1500 us)" in rig.driver.words[0]


async def test_a_brown_out_is_noticed_while_it_drives(rig):
    await rig.driving()
    rig.board.held_us = 0.0
    async with asyncio.timeout(0.6):
        while rig.driver.send(Drive(1.0, 0.1)):
            await asyncio.sleep(0.01)
    await until(lambda: "does not hold its throttle" in rig.driver.health.message)


async def test_silence_ends_the_connection_while_it_drives(rig):
    await rig.driving()
    rig.board.silence = True
    began_s = rig.clock()
    while rig.driver.send(Drive(1.0, 0.1)):
        await asyncio.sleep(0.01)
    assert rig.clock() - began_s < 0.6


@pytest.mark.parametrize(("held_us", "words"), [(1234.0, "is at 1234 us"), (None, "no answer of a Maestro")])
async def test_what_is_no_maestro_is_named(rig, held_us, words):
    rig.board.held_us, rig.board.silence = held_us, held_us is None
    await until(lambda: words in rig.driver.health.message)
