"""The operator's desk at work: a beat for every operator, and a look for the silence that no message announces."""

import math
from collections.abc import Callable
from typing import Final

from drivers.api import Motor
from runtime.teleop.desk import OperatorDesk

EVERY_UNHEARD: Final = 3
"""While no operator speaks, only every third beat is sent: enough to see the car and to speak to it, for a third of the
work, and one that is lost is not yet a lost link (0.2 s). From the first command on every beat is sent."""


class DeskTicker:
    """Has the desk look, and beats. `publish` sends a beat at once or not at all, and must not wait."""

    def __init__(self, desk: OperatorDesk, motor: Motor, publish: Callable[[bytes], None]) -> None:
        self._desk = desk
        self._motor = motor
        self._publish = publish
        self._unheard = -1  # the first beat at once

    def tick(self, _late_s: float, _missed: int) -> None:
        """Look once, at the rate of the beats; a `periodic.Tick`."""
        desk = self._desk
        desk.tick()
        self._unheard = 0 if desk.is_attended else (self._unheard + 1) % EVERY_UNHEARD
        if self._unheard == 0:
            state = self._motor.state
            self._publish(desk.beat(state.speed_mps if state is not None else math.nan).pack())
