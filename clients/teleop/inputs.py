"""Operator's inputs at this moment, independent of the device. Level, not edge: the complete state, every time."""

import math
from dataclasses import dataclass
from enum import StrEnum

from wallride.runtime.wire.teleop import Input

CENTRED = 0.2
"""Maximum deflection of a stick that counts as released (half range = 1)."""


class Control(StrEnum):
    """Controls that every device must offer; the values are the names in files and scripts."""

    SPEED = "speed"
    STEERING = "steering"
    MANUAL = "manual"
    AUTONOMY = "autonomy"
    ESTOP = "estop"
    RESET = "reset"
    TAKE_OVER = "take_over"


STICKS = (Control.SPEED, Control.STEERING)
BUTTONS = (Control.MANUAL, Control.AUTONOMY, Control.ESTOP, Control.RESET, Control.TAKE_OVER)


@dataclass(frozen=True, slots=True)
class Inputs:
    """Inputs held now.

    live: the device is connected and sends; inputs of a dead device do not count.
    pressed: every button that is down.
    event_s: monotonic time of the last raw event, -inf before the first.
    speed, steering: -1 to 1, positive forward and to the left, unshaped.
    device: its name, for the screen. trouble: what is wrong with it and what to do, "" when all is well.
    """

    kind: Input
    live: bool
    event_s: float = -math.inf
    pressed: frozenset[Control] = frozenset()
    speed: float = 0.0
    steering: float = 0.0
    device: str = ""
    trouble: str = ""

    @property
    def centred(self) -> bool:
        """Return whether both sticks are released; false for NaN."""
        return abs(self.speed) <= CENTRED and abs(self.steering) <= CENTRED

    @property
    def manual(self) -> bool:
        """Return whether the deadman for driving by hand is held."""
        return Control.MANUAL in self.pressed

    @property
    def autonomy(self) -> bool:
        """Return whether the permit for autonomy is held."""
        return Control.AUTONOMY in self.pressed

    @property
    def sound(self) -> bool:
        """Return whether both sticks are numbers; an untrusted axis is NaN."""
        return math.isfinite(self.speed) and math.isfinite(self.steering)

    @property
    def released(self) -> bool:
        """Return whether nothing at all is held."""
        return self.centred and not self.pressed

    @property
    def wants_stop(self) -> bool:
        """Return whether this is an e-stop: the button itself, or both deadmen at once."""
        return Control.ESTOP in self.pressed or (self.manual and self.autonomy)

    def only(self, control: Control) -> bool:
        """Return whether this one button is held and nothing else."""
        return self.centred and self.pressed == {control}
