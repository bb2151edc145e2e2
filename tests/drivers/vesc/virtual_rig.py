"""A driver and the far end of its wire in virtual time: what is promised of times and bytes, whatever the machine does.

Between them is a real pair of sockets in place of the serial port.
"""

import asyncio
import contextlib
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any
from unittest import mock

from wallride.drivers.api import Drive, LinkLost
from wallride.drivers.link import ByteLink
from wallride.drivers.vesc import codec, driver
from wallride.drivers.vesc.codec import Packet
from wallride.drivers.vesc.driver import Vesc
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.devices.vesc_replies import firmware_reply, values_reply
from wallride.sim.virtual.virtual_time import run_virtual

ANSWERS_AFTER_S = 0.002
FIRMWARE = (6, 5)
GAIN = VescSettings().speed_to_erpm_gain
FASTEST_ERPM = 10**5
"""What is shown above it is an error: the wheels turn at 1 m/s."""


class Controller:
    """The far end: answers after a moment.

    erpm, fault_code: what it reports. answers: whether it does. commands: every motor command with its time.
    heard: all payloads.
    """

    def __init__(self, end: socket.socket) -> None:
        self._end, self._deframer, self._loop = end, codec.VescDeframer(), asyncio.get_running_loop()
        self.erpm = round(GAIN)
        self.fault_code = 0
        self.answers = True
        self._turned_s, self._turned, self._turned_abs = self._loop.time(), 0.0, 0.0
        self.commands: list[tuple[float, int]] = []
        self.heard: list[bytes] = []
        self._loop.add_reader(end, self._on_readable)

    def _on_readable(self) -> None:
        for payload in self._deframer.feed(self._end.recv(4096)):
            self.heard.append(payload)
            if payload[0] == Packet.FW_VERSION:
                self._answer(firmware_reply(FIRMWARE))
            elif payload[0] == Packet.GET_VALUES:
                self._answer(values_reply(FIRMWARE, self._values()))
            elif payload[0] in {Packet.SET_RPM, Packet.SET_CURRENT_BRAKE}:
                self.commands.append((self._loop.time(), payload[0]))

    def _values(self) -> dict[str, float]:
        now_s = self._loop.time()
        step = (now_s - self._turned_s) * (self.erpm if abs(self.erpm) < FASTEST_ERPM else GAIN) / 10
        self._turned_s, self._turned, self._turned_abs = now_s, self._turned + step, self._turned_abs + abs(step)
        return {
            "erpm": self.erpm, "voltage_v": 11.8, "fault_code": self.fault_code,
            "tachometer": round(self._turned), "tachometer_abs": round(self._turned_abs),
        }  # fmt: skip

    def _answer(self, payload: bytes) -> None:
        if self.answers:
            self._loop.call_later(ANSWERS_AFTER_S, self._send, codec.frame(payload))

    def _send(self, data: bytes) -> None:
        with suppress(OSError):  # the driver has closed its end
            self._end.send(data)

    def motor(self) -> list[bytes]:
        """Return the motor and servo commands that came."""
        return [payload for payload in self.heard if payload[0] not in {Packet.FW_VERSION, Packet.GET_VALUES}]


class Rig:
    """One driver on one wire.

    writes: every piece that the driver wrote at once. broken: writing fails, as to a port that has gone.
    released: how often the driver has let the port go.
    """

    def __init__(self, **settings: Any) -> None:
        self.loop = asyncio.get_running_loop()
        self.near, far = socket.socketpair()
        self.near.setblocking(False)
        self.controller = Controller(far)
        self._far = far
        self.writes: list[bytes] = []
        self.broken = False
        self.released = 0
        self.vesc = Vesc(VescSettings.model_validate(settings), clock=self.loop.time)

    async def open(self, address: Any, clock: Any) -> ByteLink:
        """Open the port, in place of `open_link`."""
        rig = self

        class Overheard(ByteLink):
            def write(self, data: bytes) -> None:
                if rig.broken:
                    raise LinkLost("gone")
                rig.writes.append(data)
                super().write(data)

        def released(_lost: bool) -> None:
            rig.released += 1

        return Overheard(address, self.near.fileno(), released, clock)

    def sent(self, drive: Drive) -> bytes:
        """Send one command; return all that was written."""
        count = len(self.writes)
        assert self.vesc.send(drive)
        assert len(self.writes) == count + 1, "in one write"
        return self.writes[-1]

    def close(self) -> None:
        """Close both ends."""
        self.loop.remove_reader(self._far)
        self._far.close()
        self.near.close()


def play(story: Callable[[Rig], Awaitable[None]], **settings: Any) -> Rig:
    """Let a driver run while a story is told; it is cancelled at its end. Returns the rig."""

    async def main() -> Rig:
        rig = Rig(**settings)
        with mock.patch.object(driver, "open_link", rig.open):
            task = asyncio.ensure_future(rig.vesc.run())
            try:
                await story(rig)
            finally:
                task.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await task
                rig.close()
        return rig

    return run_virtual(main())
