"""The gamepad on the car as one more operator: its sticks and buttons become commands to the car's own desk."""

import logging
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Never

from wallride.clients.joystick.devices import LinuxPads
from wallride.clients.teleop.pads import Layout
from wallride.clients.teleop.pilot import DeadmanFault, Pilot
from wallride.clients.teleop.shaping import InputShape
from wallride.clients.teleop.sources import PLUG_IN, PadSource
from wallride.runtime.wire.teleop import read_beat

log = logging.getLogger("wallride.joystick")

NAME: Final = "the pad on the car"
GONE_S: Final = 0.5
"""How long a pad that is gone is reported; then the desk loses this operator, and another one may drive."""
SILENT: Final = "the pad is silent: is it on? Release everything, move a stick, press again; move it now and then"


class CarJoystick:
    """A `wallride.runtime.teleop.local_operator.LocalOperator`: without a pad it says nothing, and needs nothing.

    session: random and not 0. own: layouts of unknown pads by GUID or USB id.
    """

    def __init__(
        self, pads: LinuxPads, session: int, shape: InputShape, own: Mapping[str, Layout] = MappingProxyType({})
    ) -> None:
        self._pads = pads
        self._source = PadSource(pads, own)
        self._pilot = Pilot(session, NAME, shape)
        self._live_s = -math.inf
        self._told = ""

    async def watch(self) -> Never:
        """Look for pads that come, for ever."""
        await self._pads.watch()

    def hear(self, beat: bytes, arrival_s: float) -> None:
        """Take the car's heartbeat; without a pad there is nothing to answer."""
        if self._source.has_pad:
            self._pilot.hear(read_beat(beat), arrival_s)

    def command(self, now_s: float) -> bytes | None:
        """Return the command to the desk, at the rate of the heartbeats; None without a pad."""
        inputs = self._source.poll(now_s, ready=True)
        if inputs.live:
            self._live_s = now_s
        elif now_s - self._live_s > GONE_S:
            self._tell(inputs.trouble)
            return None
        command, state = self._pilot.step(inputs, now_s), self._pilot.situation
        is_silent = state is not None and not state.armed and state.closed_by is DeadmanFault.FROZEN
        ready = SILENT if is_silent else f"{inputs.device}: hold LB to drive, RB to permit"
        self._tell(ready if inputs.live else inputs.trouble)
        return command.pack()

    def _tell(self, words: str) -> None:
        if words != self._told:
            if words != PLUG_IN or self._told:
                log.info("%s", words if words != PLUG_IN else "the pad is gone")
            self._told = words
