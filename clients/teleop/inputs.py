"""What an operator means at this moment, whatever it is pressed on. A level, not an edge: all of it, every time."""

import math
from dataclasses import dataclass
from enum import StrEnum

from runtime.wire.teleop import Input

CENTRED = 0.2
"""A stick within this of its middle counts as let go (half range = 1)."""


class Control(StrEnum):
    """Everything a device must offer; the values are the names in files and scripts."""

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
    """What is held down now.

    live: the device is there and speaks; what a dead device says does not count.
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
        """Whether both sticks are let go; false for anything that is not a number."""
        return abs(self.speed) <= CENTRED and abs(self.steering) <= CENTRED

    @property
    def manual(self) -> bool:
        """Whether the deadman for driving by hand is held."""
        return Control.MANUAL in self.pressed

    @property
    def autonomy(self) -> bool:
        """Whether the permit for autonomy is held."""
        return Control.AUTONOMY in self.pressed

    @property
    def sound(self) -> bool:
        """Whether both sticks are numbers; an axis that is not to be trusted is none."""
        return math.isfinite(self.speed) and math.isfinite(self.steering)

    @property
    def released(self) -> bool:
        """Whether nothing at all is held."""
        return self.centred and not self.pressed

    @property
    def wants_stop(self) -> bool:
        """Whether this is an e-stop: the button itself, or both deadmen at once."""
        return Control.ESTOP in self.pressed or (self.manual and self.autonomy)

    def only(self, control: Control) -> bool:
        """Whether this one button is held and nothing else."""
        return self.centred and self.pressed == {control}
