"""The requests to a kernel's input device, and its answers, over a pipe in place of one."""

import asyncio
import errno
import fcntl
import os
import struct
from pathlib import Path

import pytest

from tests.clients.joystick.fake_pads import F710_X, KEYBOARD, LB
from wallride.clients.joystick import devices
from wallride.clients.joystick.devices import EvdevDevice, LinuxPads
from wallride.clients.joystick.evdev import EV_ABS, EV_KEY, RECORD
from wallride.clients.teleop.gamepad import Gone, PadConnected, PadMoved
from wallride.clients.teleop.pads import Button

GRAB = 0x4004_4590


class Kernel:
    """Answers the requests of linux/input.h for one pad whose records come through a FIFO."""

    def __init__(self, description, down=()):
        self.description, self.down, self.grabs = description, down, 0

    def ioctl(self, _file, request, argument):
        said = self.description
        if request == GRAB:
            self.grabs += argument
            return 0
        if 0x8018_4540 <= request < 0x8018_4540 + 0x40:
            low, high = said.ranges[request - 0x8018_4540]
            return struct.pack("<6i", (low + high + 1) // 2, low, high, 16, 128, 0)
        answers = {
            0x8008_4502: struct.pack("<4H", *said.identity),
            0x8100_4506: said.name.encode() + b"\0",
            0x8060_4521: bits(said.keys, 96),
            0x8008_4523: bits([*said.ranges, 40], 8),
            0x8060_4518: bits(self.down, 96),
        }
        return answers[request].ljust(len(argument), b"\0")


def bits(codes, size):
    raw = bytearray(size)
    for code in codes:
        raw[code // 8] |= 1 << code % 8
    return bytes(raw)


@pytest.fixture
def pipe(tmp_path, monkeypatch):
    path = tmp_path / "event3"
    os.mkfifo(path)
    held = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    yield path, held
    os.close(held)


def test_a_device_is_described_grabbed_and_read(pipe, monkeypatch):
    path, end = pipe
    kernel = Kernel(F710_X, down=[LB])
    monkeypatch.setattr(fcntl, "ioctl", kernel.ioctl)
    device = EvdevDevice(path)
    assert (device.description.name, device.description.identity) == (F710_X.name, F710_X.identity)
    assert tuple(device.description.keys) == F710_X.keys
    assert device.description.ranges == F710_X.ranges, "a code above the hats is no axis of a pad"
    assert kernel.grabs == 1
    assert (EV_KEY, LB, 1) in device.state()
    assert (EV_ABS, 2, 128) in device.state()
    assert device.read() == b""
    os.write(end, RECORD.pack(1, 2, EV_KEY, LB, 0))
    assert device.read() == RECORD.pack(1, 2, EV_KEY, LB, 0)
    device.close()


def test_what_is_no_pad_is_not_grabbed(pipe, monkeypatch):
    kernel = Kernel(KEYBOARD)
    monkeypatch.setattr(fcntl, "ioctl", kernel.ioctl)
    device = EvdevDevice(pipe[0])
    assert kernel.grabs == 0
    device.close()


def test_a_file_that_is_no_input_device_is_closed_again(tmp_path):
    (tmp_path / "event3").write_text("text")
    before = set(Path("/proc/self/fd").iterdir())
    with pytest.raises(OSError, match=os.strerror(errno.ENOTTY)):
        EvdevDevice(tmp_path / "event3")
    assert set(Path("/proc/self/fd").iterdir()) == before


async def test_a_pad_that_comes_is_found_and_one_that_goes_is_told(pipe, monkeypatch):
    path, end = pipe
    monkeypatch.setattr(fcntl, "ioctl", Kernel(F710_X, down=[LB]).ioctl)
    monkeypatch.setattr(devices, "LOOK_EVERY_S", 0.01)
    pads = LinuxPads(path.parent)
    watching = asyncio.create_task(pads.watch())
    happened = []
    async with asyncio.timeout(10):
        while not happened:
            await asyncio.sleep(0.01)
            happened = pads.poll()
    assert [type(one) for one in happened] == [PadConnected, PadMoved]
    assert happened[1].event == Button(4, pressed=True), "what is held when it is plugged in"
    os.write(end, RECORD.pack(1, 2, EV_KEY, LB, 0))
    assert pads.poll() == [PadMoved(1, Button(4, pressed=False))]

    def gone(*_):
        raise OSError(errno.ENODEV, "No such device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "read", gone)
        assert pads.poll() == [Gone(1)]
    watching.cancel()
    await asyncio.gather(watching, return_exceptions=True)
    for device in [pad.device for pad in pads._pads.values()]:
        device.close()
