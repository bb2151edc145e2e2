"""Whole-process stories on real wires, named after what happens. Real time, so the bounds are the car's own limits."""

import asyncio
import signal
import time

import pytest

from tests.promises import promise
from tests.system.bench import CORRIDOR_MM, bench
from wallride.drivers.vesc.codec import Packet

BRAKE_WITHIN_S = 0.25
"""From the last good scan to the first brake on the wire."""


@pytest.fixture
async def car(tmp_path):
    """A car on the bench that drives."""
    async with bench(tmp_path) as car:
        await car.until_driving()
        yield car


async def test_sigterm_at_full_speed_brakes_at_once_and_exits_with_0(tmp_path):
    async with bench(tmp_path, "wall_follow.speed_mps=4") as car:
        await car.until_driving(3.9)
        asked_s = time.monotonic()
        car.runtime.kill(signal.SIGTERM)
        assert await car.runtime.wait() == 0
        took_s = car.first_brake_s(asked_s) - asked_s
        moves = [p for at_s, p in car.motor_commands(car.first_brake_s(asked_s)) if p[0] != Packet.SET_CURRENT_BRAKE]
        assert moves == []
        assert car.wheel_mps < 0.1, "it left a rolling car"
        promise("braking after SIGTERM", took_s, 0.1)


async def test_sigint_is_the_same(car):
    car.runtime.kill(signal.SIGINT)
    assert await car.runtime.wait() == 0
    assert car.motor_commands()[-1][1][0] == Packet.SET_CURRENT_BRAKE


async def test_after_kill_9_the_vescs_own_timeout_stops_the_car(tmp_path):
    async with bench(tmp_path, timeout_s=0.15) as car:
        await car.until_driving()
        car.runtime.kill(signal.SIGKILL)
        killed_s = time.monotonic()
        await car.until(lambda: car.vesc.demand(time.monotonic()).kind != "speed", "exit: the VESC lets go", 1.0)
        promise("the VESC's timeout", time.monotonic() - killed_s, 0.3)


async def test_a_silent_lidar_brakes_and_a_talking_one_drives_on(car):
    car.scan_mm = None
    await car.until(lambda: car.wheel_mps == 0, "standing")
    took_s = car.first_brake_s(car.last_good_scan_s) - car.last_good_scan_s
    car.scan_mm = CORRIDOR_MM
    await car.until_driving()
    promise("braking for a silent lidar", took_s, BRAKE_WITHIN_S)


async def test_a_burst_after_a_stall_drives_by_nothing_stale(car):
    car.scip.stall()
    stalled_s = time.monotonic()
    await asyncio.sleep(0.7)
    took_s = car.first_brake_s(stalled_s) - stalled_s
    assert car.wheel_mps == 0
    car.scan_mm = None  # after the burst of old scans nothing new comes
    released_s = time.monotonic()
    car.scip.release()
    await asyncio.sleep(0.3)
    fresh_for_s = 0.15 + 0.1  # newest held scan may be 25 ms old, and lives 150 ms
    moves = [
        at_s for at_s, p in car.motor_commands(released_s) if p[0] == Packet.SET_RPM and at_s > released_s + fresh_for_s
    ]
    assert moves == []
    promise("braking for a stalled lidar", took_s, BRAKE_WITHIN_S)


async def test_a_lidar_that_dribbles_byte_by_byte_drives_the_car_all_the_same(car):
    car.scip.dribble_s = 0.015
    await asyncio.sleep(1.5)
    await car.until(lambda: car.wheel_mps >= 0.9, "it drives all the same")
    assert car.runtime.exit_code is None


async def test_noise_and_bad_checksums_cost_scans_not_the_drive(car):
    car.scip.bad_checksum_every = 4
    car.scip.garbage_every = 5
    await asyncio.sleep(1.5)
    assert car.wheel_mps >= 0.9


@pytest.mark.parametrize("back", [True, False])
async def test_an_unplugged_vesc_is_waited_for_and_met_gently(car, back):
    car.vesc.unplug()
    await asyncio.sleep(0.5)
    assert car.runtime.exit_code is None
    if not back:
        car.runtime.kill(signal.SIGTERM)
        assert await car.runtime.wait() == 0
        return
    car.wheel_mps = 0.0
    replugged_s = time.monotonic()
    car.vesc.replug()
    await car.until(lambda: len(car.motor_commands(replugged_s)) > 0, "commands again")
    speeds = [int.from_bytes(p[1:5], "big") for _, p in car.motor_commands(replugged_s)[:3] if p[0] == Packet.SET_RPM]
    assert all(erpm < 0.5 * 4614 for erpm in speeds)
    await car.until_driving()


async def test_missing_devices_are_waited_for(tmp_path):
    async with bench(tmp_path) as car:
        car.vesc.unplug()
        car.scip.refuse()
        car.scip.disconnect()
        await asyncio.sleep(1.0)
        assert car.runtime.exit_code is None
        car.vesc.replug()
        car.scip.listen_again()
        await car.until_driving()


async def test_without_a_permit_it_brakes_and_stays(tmp_path):
    async with bench(tmp_path, "operator.permit=required") as car:
        await car.until(lambda: len(car.motor_commands()) > 20, "commands")
        await asyncio.sleep(0.5)
        assert {payload[0] for _, payload in car.motor_commands()} == {Packet.SET_CURRENT_BRAKE}
