"""Lidar and motor controller on each other's port: the car stands, and says of both that they are not what they are."""

import pytest

from tests.system.bench import bench
from wallride.drivers.vesc.codec import Packet, VescDeframer
from wallride.sim.devices.scip import ScipEmulator

SAID_WITHIN_S = 20.0


class ListeningLidar(ScipEmulator):
    """Keeps what comes in, to be read as a motor controller would."""

    def __init__(self):
        super().__init__()
        self.heard = bytearray()

    def _on_bytes(self, chunk):
        self.heard += chunk
        super()._on_bytes(chunk)


async def start_lidar(kind, folder):
    """Return a lidar on a port of its own, and its address."""
    lidar = ListeningLidar()
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
            asked = {payload[0] for payload in VescDeframer().feed(bytes(lidar.heard))}
            assert asked == {Packet.FW_VERSION}, "a stranger is asked who it is, and gets no command"
            assert car.motor_commands() == []
    finally:
        lidar.close()
