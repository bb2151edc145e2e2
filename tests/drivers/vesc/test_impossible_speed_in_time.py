"""How soon an impossible speed is a brake on the wire: promised in virtual time, whatever the machine does."""

import asyncio

import pytest

from tests.drivers.vesc.rig import play
from wallride.drivers.api import Drive
from wallride.drivers.vesc.codec import Packet

BRAKES_WITHIN_S = 0.1
SHOWN_S, LASTS_S, ENDS_S = 0.5, 0.3, 1.35
COMMANDS_EVERY_S = 0.025
"""As often as scans come; the mux sends between them as well."""


def shown(erpm, phase_s):
    """Show an impossible speed for a while; return the commands in it and after it, in seconds since it began."""
    begun_s = SHOWN_S + phase_s

    async def story(rig):
        loop = asyncio.get_running_loop()
        loop.call_at(begun_s, setattr, rig.controller, "shown_erpm", erpm)
        loop.call_at(begun_s + LASTS_S, setattr, rig.controller, "shown_erpm", None)
        while loop.time() < ENDS_S:
            rig.vesc.send(Drive(1.0, 0.0))
            await asyncio.sleep(COMMANDS_EVERY_S)

    wire = play(story).controller.wire
    kinds = {Packet.SET_RPM, Packet.SET_CURRENT_BRAKE}
    return [(at_s - begun_s, payload[0]) for at_s, payload in wire if at_s >= begun_s and payload[0] in kinds]


@pytest.mark.parametrize("erpm", [10**6, -(2**31)])
def test_an_impossible_speed_is_a_brake_on_the_wire_within_a_tenth_of_a_second(erpm):
    for phase_ms in range(0, 25, 3):
        commands = shown(erpm, phase_ms / 1000)
        brakes_s = [at_s for at_s, command in commands if command == Packet.SET_CURRENT_BRAKE]
        assert brakes_s[0] <= BRAKES_WITHIN_S
        meanwhile = [command for at_s, command in commands if brakes_s[0] <= at_s < LASTS_S]
        assert len(meanwhile) >= 6, "until the link is lost, 0.2 s after the last believed reply"
        assert set(meanwhile) == {Packet.SET_CURRENT_BRAKE}
        after = [command for at_s, command in commands if LASTS_S + 0.1 < at_s < 0.8]
        assert set(after) == {Packet.SET_RPM}
