"""PCA9685: golden registers, and every loss of it stops the car with its reason."""

import asyncio

import pytest

from tests.waiting import until
from wallride.drivers.api import Drive, LinkState
from wallride.drivers.pca9685 import codec
from wallride.drivers.pca9685.driver import Pca9685
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.pwm.driver import UNGUARDED_MPS
from wallride.drivers.pwm.speed import EstimatedSpeed
from wallride.drivers.pwm.speed_loop import STALLED
from wallride.runtime.ending import end
from wallride.sim.devices.esc import EmulatedEsc, EscModel
from wallride.sim.devices.pca9685 import Pca9685Chip, Pca9685Socket

SETTINGS = Pca9685Settings(arming_s=0.2)


def test_registers_are_those_of_the_data_sheet():
    assert codec.prescale(60.0) == 0x65
    assert codec.prescale(200.0) == 0x1E  # the example of the data sheet
    assert codec.counts(1500.0, 0x65) == bytes((0, 0, 0x70, 0x01))
    assert codec.pulse_us(codec.counts(1500.0, 0x65), 0x65) == pytest.approx(1500.0, abs=2.1)
    assert codec.output(0) == 0x06
    assert codec.output(15) == 0x42


def test_neighbours_are_written_at_once_and_others_throttle_first():
    together = codec.writes(SETTINGS, 0x65, 1500.0, 1600.0)
    assert together == [bytes((0x06,)) + codec.counts(1600.0, 0x65) + codec.counts(1500.0, 0x65)]
    apart = codec.writes(Pca9685Settings(throttle_channel=7, steering_channel=2), 0x65, 1500.0, 1600.0)
    assert [data[0] for data in apart] == [codec.output(7), codec.output(2)]


class Rig:
    def __init__(self, **settings):
        clock = asyncio.get_running_loop().time
        self.esc = EmulatedEsc(EscModel(armed_after_s=0.1))
        self.chip = Pca9685Chip(self.esc, clock=clock)
        self.driver = Pca9685(SETTINGS.model_copy(update=settings), open_bus=self.chip.open, clock=clock)

    async def driving(self, speed_mps=1.0):
        await until(lambda: self.driver.health.link is LinkState.READY)
        for _ in range(60):
            self.drive_on(speed_mps)
            await asyncio.sleep(0.01)

    def drive_on(self, speed_mps):
        self.driver.learn(EstimatedSpeed(self.driver._clock(), self.esc.speed_mps or 0.0, 0.05))
        return self.driver.send(Drive(speed_mps, 0.1))


@pytest.fixture
async def rig():
    made = Rig()
    running = asyncio.create_task(made.driver.run())
    yield made
    await end(running)
    assert made.chip.open_buses == 0


async def test_unplugged_it_is_absent_with_its_reason_at_the_next_command(rig):
    await rig.driving()
    rig.chip.unplugged = True
    assert not rig.drive_on(1.0)
    assert rig.driver.state is None
    assert rig.driver.health.link is LinkState.ABSENT
    assert "no acknowledgement (power? wiring?" in rig.driver.health.message
    assert rig.driver.health.counts["lost"] == 1


async def test_one_transfer_without_acknowledgement_ends_the_connection_and_it_comes_back(rig):
    await rig.driving()
    rig.chip.nack_every = 1
    rig.drive_on(1.0)
    rig.chip.nack_every = None
    await until(lambda: rig.driver.health.link is LinkState.READY)
    assert rig.driver.health.counts["reconnect"] == 1
    assert rig.esc.speed_mps is None  # neutral: nothing moves by itself


async def test_a_car_that_was_lost_while_it_drove_is_braked_before_its_esc_is_armed(rig):
    await rig.driving()
    rig.chip.unplugged = True
    rig.drive_on(1.0)
    assert rig.esc.speed_mps is not None  # the chip goes on by itself
    rig.chip.unplugged = False
    await until(lambda: rig.esc.demand(0.0).kind == "brake")
    await until(lambda: rig.driver.health.link is LinkState.READY)


async def test_a_chip_that_was_reset_is_noticed_without_a_command(rig):
    await rig.driving()
    rig.chip.brown_out()
    await until(lambda: "it was reset while it drove (brown-out" in rig.driver.health.message)
    assert rig.driver.state is None
    await until(lambda: rig.driver.health.link is LinkState.READY)
    assert rig.driver.health.counts["lost"] == 1


async def test_another_programs_throttle_is_noticed(rig):
    await rig.driving()
    rig.chip.open(1, 0x40).write(bytes((codec.output(0),)) + codec.counts(1900.0, 0x65))
    rig.chip.open_buses -= 1
    await until(lambda: rig.driver.state is None)
    assert rig.driver.health.link is not LinkState.READY


async def test_without_a_command_timeout_it_is_slow_and_says_so(rig):
    await rig.driving(9.0)
    assert (rig.esc.speed_mps or 0.0) < UNGUARDED_MPS + 0.4
    assert rig.driver.words[0] == f"the motor allows {UNGUARDED_MPS:.1f} m/s: its board has no command timeout"


async def test_where_the_scans_tell_no_speed_it_is_slow_and_says_so(rig):
    await until(lambda: rig.driver.health.link is LinkState.READY)
    assert rig.driver.send(Drive(2.0, 0.0))
    assert rig.esc.speed_mps == pytest.approx(SETTINGS.blind_speed_mps, abs=0.05)
    assert "the scans do not tell the speed: 0.5 m/s at most" in rig.driver.words


async def test_a_contradiction_brakes_and_stays_until_it_is_cleared(rig):
    await rig.driving()
    rig.driver._loop.fault = STALLED
    rig.drive_on(1.0)
    rig.drive_on(1.0)
    assert rig.driver.state.fault == STALLED
    assert rig.driver.health.link is LinkState.FAULTY
    assert rig.driver.braked_instead
    assert rig.esc.demand(0.0).kind == "brake"
    rig.driver.retry_fault()
    assert rig.driver.state.fault
    rig.driver.clear_fault()
    rig.drive_on(1.0)
    assert rig.esc.speed_mps is not None


async def test_the_last_act_brakes(rig):
    await rig.driving()
    rig.driver.brake_now()
    assert rig.esc.demand(0.0).kind == "brake"


async def test_a_socket_carries_the_transfers_of_another_process(tmp_path):
    clock, esc = asyncio.get_running_loop().time, EmulatedEsc(EscModel(armed_after_s=0.1))
    chip = Pca9685Chip(esc, clock=clock)
    server = Pca9685Socket(chip, tmp_path / "i2c")
    driver = Pca9685(SETTINGS.model_copy(update={"socket": str(tmp_path / "i2c")}), clock=clock)
    running = asyncio.create_task(driver.run())

    await until(lambda: driver.health.link is LinkState.READY)
    assert driver.send(Drive(0.5, 0.1))
    assert esc.speed_mps == pytest.approx(0.5, abs=0.05)
    chip.unplugged = True
    await until(lambda: driver.health.link is LinkState.ABSENT)
    assert "no acknowledgement" in driver.health.message
    await end(running)
    server.close()


async def test_a_missing_bus_is_named():
    driver = Pca9685(Pca9685Settings(bus=250))
    running = asyncio.create_task(driver.run())
    await asyncio.sleep(0.05)
    await end(running)
    assert "/dev/i2c-250: no such bus (enable I2C" in driver.health.message
