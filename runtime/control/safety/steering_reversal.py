"""Steering reversals: a driver that suddenly changes the side of its steering may change it back.

A free arc allows the car to drive at a wall before which it can no longer stop, because it is about to turn away from
it. That requires a driver that does turn. One that has just jumped from one side to the other (the followed wall joins
another one in this scan and not in the next; a thumb on a joystick) may jump back when it is too late for a stop. So
for a moment the path that was given up counts as well as the one commanded now: not with a stop, which would take the
steering away from a driver that means it, but with the graded limit, so that a stop is possible after a second change.
"""

import math
from typing import NamedTuple

WAVERS_S = 0.3
"""Duration for which the given-up side counts: the servo needs 0.21 s from end to end, the car's response 0.07 s."""
MEANT_S = 0.1
"""Minimum duration of a steering command that counts; a shorter one was an error of a scan or two, without effect."""
LAST_WISH_S = 0.3
"""Maximum age of the previous command; an older one was given up long ago, or was another source's."""


class SteeringReversal(NamedTuple):
    """The last steering command, since when it is on its side, and the side that was given up, which counts until_s."""

    wish_rad: float = math.nan
    wished_s: float = -math.inf
    since_s: float = -math.inf
    given_up_rad: float = math.nan
    until_s: float = -math.inf

    def after(self, steering_rad: float, now_s: float, jump_rad: float) -> "SteeringReversal":
        """Return the state after a steering command.

        jump_rad: angle by which the wheels can turn before the car responds; a smaller change of side is mere steering.
        """
        _, _, since_s, given_up_rad, until_s = self
        if now_s - self.wished_s > LAST_WISH_S:
            since_s = now_s
        elif self.wish_rad * steering_rad < 0.0 and abs(steering_rad - self.wish_rad) > jump_rad:
            if now_s - since_s >= MEANT_S:
                given_up_rad, until_s = self.wish_rad, now_s + WAVERS_S
            since_s = now_s
        return SteeringReversal(steering_rad, now_s, since_s, given_up_rad, until_s)

    @property
    def wavers(self) -> bool:
        """Whether the last command has recently replaced given_up_rad, on the other side."""
        return self.wished_s < self.until_s and self.given_up_rad * self.wish_rad < 0.0
