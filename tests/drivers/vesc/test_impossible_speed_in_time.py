"""How soon an impossible speed is a brake on the wire: promised in virtual time, whatever the machine does."""

import asyncio
import math
import socket

import pytest

from drivers.api import Drive, LinkState
from drivers.link import ByteLink
from drivers.vesc import codec, driver
from drivers.vesc.codec import Packet
from drivers.vesc.driver import Vesc
from drivers.vesc.settings import VescSettings
from sim.devices.vesc_replies import firmware_reply, values_reply
from sim.virtual.virtual_time import run_virtual

BRAKES_WITHIN_S = 0.1
LASTS_S = 0.3
COMMANDS_EVERY_S = 0.025
"""As often as scans come; the mux sends between them as well."""
ANSWERS_AFTER_S = 0.002
FIRMWARE = (6, 5)
GAIN = VescSettings().speed_to_erpm_gain


class Controller:
    """The far end of a VESC's wire: answers after a moment, and keeps every motor command with its time."""

    def __init__(self, end: socket.socket) -> None:
        self._end, self._deframer, self._loop = end, codec.VescDeframer(), asyncio.get_running_loop()
        self.erpm = round(GAIN)
        self.commands: list[tuple[float, int]] = []
        self._loop.add_reader(end, self._on_readable)

    def _on_readable(self) -> None:
        for payload in self._deframer.feed(self._end.recv(4096)):
            if payload[0] == Packet.FW_VERSION:
                self._answer(firmware_reply(FIRMWARE))
            elif payload[0] == Packet.GET_VALUES:
                turned = round(self._loop.time() * GAIN / 10)
                counted = {"tachometer": turned, "tachometer_abs": turned}
                self._answer(values_reply(FIRMWARE, {"erpm": self.erpm, "voltage_v": 11.8, **counted}))
            elif payload[0] in {Packet.SET_RPM, Packet.SET_CURRENT_BRAKE}:
                self.commands.append((self._loop.time(), payload[0]))

    def _answer(self, payload: bytes) -> None:
        self._loop.call_later(ANSWERS_AFTER_S, self._end.send, codec.frame(payload))

    def close(self) -> None:
        self._loop.remove_reader(self._end)
        self._end.close()


async def shown(monkeypatch, erpm, phase_s):
    """Show an impossible speed for a while; return the commands in it and after it, in seconds since it began."""
    loop = asyncio.get_running_loop()
    near, far = socket.socketpair()
    near.setblocking(False)
    controller = Controller(far)

    async def connected(address, clock):
        return ByteLink(address, near.fileno(), lambda _: None, clock)

    monkeypatch.setattr(driver, "open_link", connected)
    vesc = Vesc(VescSettings(), clock=loop.time)
    task = asyncio.ensure_future(vesc.run())
    begun_s = math.inf
    while loop.time() < 2.0:
        vesc.send(Drive(1.0, 0.0))
        await asyncio.sleep(COMMANDS_EVERY_S)
        if vesc.health.link is LinkState.READY and begun_s == math.inf and loop.time() > 1.0:
            begun_s = loop.time() + phase_s
            loop.call_at(begun_s, setattr, controller, "erpm", erpm)
            loop.call_at(begun_s + LASTS_S, setattr, controller, "erpm", round(GAIN))
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    controller.close()
    near.close()
    return [(at_s - begun_s, command) for at_s, command in controller.commands if at_s >= begun_s]


@pytest.mark.parametrize("erpm", [10**6, 10**7, 2**31 - 1, -(2**31)])
def test_an_impossible_speed_is_a_brake_on_the_wire_within_a_tenth_of_a_second(monkeypatch, erpm):
    for phase_ms in range(0, 25, 3):
        commands = run_virtual(shown(monkeypatch, erpm, phase_ms / 1000))
        brakes_s = [at_s for at_s, command in commands if command == Packet.SET_CURRENT_BRAKE]
        assert brakes_s[0] <= BRAKES_WITHIN_S
        meanwhile = [command for at_s, command in commands if brakes_s[0] <= at_s < LASTS_S]
        assert len(meanwhile) >= 8
        assert set(meanwhile) == {Packet.SET_CURRENT_BRAKE}
        after = [command for at_s, command in commands if LASTS_S + 0.1 < at_s < 0.8]
        assert set(after) == {Packet.SET_RPM}
