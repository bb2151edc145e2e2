"""Lidar and board that a calibration opens itself: neutral before, after, and where no order comes."""

import asyncio
from contextlib import asynccontextmanager

import pytest

from tests.sim.live.emulated import car, running
from wallride.clients.calibration.ways import CalibrationError
from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.pulses.devices import MAX_LATE_S, PulseDevices, made_us
from wallride.runtime.settings.tree import Settings, load_settings

DRIVERS = [MaestroSettings, Pca9685Settings]


@asynccontextmanager
async def opened(tmp_path, driver):
    """Yield the emulated car, its board's ESC, and devices that are open."""
    one = car(tmp_path / "ports", motor=driver())
    boards = []
    start = one._open_motor

    def noted(stack):
        boards.append(start(stack))
        return boards[0]

    one._open_motor = noted
    async with running(one) as addresses:
        at = {"driver": driver.model_fields["driver"].default, addresses.motor_key: addresses.motor}
        devices = PulseDevices(
            Settings.model_validate({"lidar": {"address": addresses.lidar}, "motor": at}), 1500.0, 1500.0
        )
        board = boards[0][0]
        esc = getattr(board, "esc", board)
        esc.board = board
        try:
            await devices.open()
            yield one, esc, devices
        finally:
            await devices.close(1400.0, 1500.0)


async def ordered(devices, throttle_us, seconds):
    """Order a pulse after each scan, as a step does."""
    until_s = asyncio.get_running_loop().time() + seconds
    while asyncio.get_running_loop().time() < until_s:
        await devices.order(1450.0, throttle_us, 1500.0)
        await devices.next_scan()


def pulse_us(esc):
    return esc._throttle_us


@pytest.mark.parametrize("driver", DRIVERS)
async def test_the_ordered_pulses_reach_the_board_and_the_last_one_is_neutral(driver, tmp_path):
    async with opened(tmp_path, driver) as (_, esc, devices):
        assert pulse_us(esc) == pytest.approx(1500.0, abs=2.1)
        await ordered(devices, 1500.0, 1.5)
        await ordered(devices, 1590.0, 1.0)
        assert pulse_us(esc) == pytest.approx(1590.0, abs=2.1)
        assert esc.steering_rad == pytest.approx(50 / 1150, abs=0.003)
        written, pulse = [], esc.pulse

        def noted(steering_us, throttle_us, now_s):
            written.append(throttle_us)
            pulse(steering_us, throttle_us, now_s)

        esc.pulse = noted
    assert written[len(written) // 2] == pytest.approx(1400.0, abs=2.1), "it brakes first"
    assert pulse_us(esc) == pytest.approx(1500.0, abs=2.1)


@pytest.mark.parametrize("driver", DRIVERS)
async def test_a_step_that_hangs_is_in_neutral(driver, tmp_path):
    async with opened(tmp_path, driver) as (_, esc, devices):
        await ordered(devices, 1590.0, 0.5)
        await asyncio.sleep(0.6)
        assert pulse_us(esc) == pytest.approx(1500.0, abs=2.1)


@pytest.mark.parametrize("driver", DRIVERS)
async def test_a_lidar_that_falls_silent_is_said(driver, tmp_path):
    async with opened(tmp_path, driver) as (one, esc, devices):
        await ordered(devices, 1590.0, 0.5)
        one.lidars[0].silence = True
        with pytest.raises(CalibrationError, match=f"no scan for {MAX_LATE_S} s: .*the car stops"):
            await ordered(devices, 1590.0, 3.0)
    assert pulse_us(esc) == pytest.approx(1500.0, abs=2.1)


async def test_a_board_that_is_lost_is_said(tmp_path):
    async with opened(tmp_path, MaestroSettings) as (_, esc, devices):
        await ordered(devices, 1590.0, 0.5)
        esc.board.silence = True
        with pytest.raises(CalibrationError, match=r"no answer for .*power\? cable\?"):
            await ordered(devices, 1590.0, 3.0)


async def test_devices_that_are_not_there_are_said_with_the_remedy(tmp_path):
    none = Settings.model_validate({"motor": {"driver": "maestro", "address": f"serial://{tmp_path}/none"}})
    with pytest.raises(CalibrationError, match="no such device"):
        await PulseDevices(none, 1500.0, 1500.0).open()
    with pytest.raises(CalibrationError, match="wallride run writes"):
        PulseDevices(load_settings(None, ["lidar.driver=auto", "motor.driver=maestro"]), 1500.0, 1500.0)


def test_a_pca9685_has_steps():
    assert made_us(MaestroSettings(), 1501.0) == 1501.0
    assert made_us(Pca9685Settings(), 1501.0) == pytest.approx(1501.44)
