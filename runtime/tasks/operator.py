"""The ticker of the operator's desk: heartbeats for all operators, and the check for silence."""

import math
from collections.abc import Callable
from typing import Final

from wallride.drivers.api import Motor
from wallride.runtime.teleop.desk import OperatorDesk

EVERY_UNHEARD: Final = 3
"""Period of the heartbeats, in ticks, while no operator sends commands: enough to see the car and to send to it, for a
third of the work, and one lost heartbeat is not yet a lost link (0.2 s). From the first command on every heartbeat is
sent."""


class DeskTicker:
    """Checks the desk for silence and sends its heartbeats.

    `publish` sends a heartbeat at once or not at all, and must not wait.
    """

    def __init__(self, desk: OperatorDesk, motor: Motor, publish: Callable[[bytes], None]) -> None:
        self._desk = desk
        self._motor = motor
        self._publish = publish
        self._unheard = -1  # the first heartbeat at once

    def tick(self, _late_s: float, _missed: int) -> None:
        """Check once, at the rate of the heartbeats; a `periodic.Tick`."""
        desk = self._desk
        desk.tick()
        self._unheard = 0 if desk.is_attended else (self._unheard + 1) % EVERY_UNHEARD
        if self._unheard == 0:
            state = self._motor.state
            self._publish(desk.beat(state.speed_mps if state is not None else math.nan).pack())
