"""Lidar and motor controller on each other's port: the car stands, and says of both that they are not what they are."""

import pytest

from sim.devices.scip import ScipEmulator
from tests.system.bench import bench

SAID_WITHIN_S = 20.0


async def start_lidar(kind, folder):
    """Return a lidar on a port of its own, and its address."""
    lidar = ScipEmulator()
    if kind == "tcp":
        return lidar, f"tcp://127.0.0.1:{await lidar.start_tcp()}"
    lidar.start_serial(folder / "lidar")
    return lidar, f"serial://{folder / 'lidar'}"


@pytest.mark.timeout(60)
@pytest.mark.parametrize("kind", ["tcp", "serial"])
async def test_devices_on_each_others_ports_are_named_and_nothing_moves(tmp_path, kind):
    lidar, address = await start_lidar(kind, tmp_path)
    try:
        swapped = (f"lidar.address=serial://{tmp_path / 'vesc'}", f"motor.address={address}")
        async with bench(tmp_path, *swapped) as car:
            for words in ("lidar absent: serial:", f"motor absent: {address}"):
                await car.until(
                    lambda words=words: any(words in line for line in car.runtime.log), words, SAID_WITHIN_S
                )
            said = "\n".join(car.runtime.log)
            assert "(a Hokuyo?" in said
            assert "is it a VESC?" in said
            assert car.motor_commands() == []
            assert car.wheel_mps == 0.0
    finally:
        lidar.close()
