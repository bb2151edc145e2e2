"""Steering reversals: a driver that suddenly changes the side of its steering may change it back.

A free arc allows the car to drive at a wall before which it can no longer stop, because it is about to turn away from
it. That requires a driver that does turn. One that has just jumped from one side to the other (the followed wall joins
another one in this scan and not in the next; a thumb on a joystick) may jump back when it is too late for a stop. So
for a moment the path that was given up counts as well as the one commanded now: not with a stop, which would take the
steering away from a driver that means it, but with the graded limit, so that a stop is possible after a second change.
"""

import math
from dataclasses import dataclass

WAVERS_S = 0.3
"""Duration for which the given-up side counts: the servo needs 0.21 s from end to end, the car's response 0.07 s."""
MEANT_S = 0.1
"""Minimum duration of a steering command that counts; a shorter one was an error of a scan or two, without effect."""
LAST_WISH_S = 0.3
"""Maximum age of the previous command; an older one was given up long ago, or was another source's."""


@dataclass(slots=True)
class SteeringReversal:
    """Tracks the steering command, since when it is on its side, and the side that was given up."""

    _wish_rad: float = math.nan
    _wished_s: float = -math.inf
    _since_s: float = -math.inf
    _given_up_rad: float = math.nan
    _until_s: float = -math.inf

    def given_up_rad(self, steering_rad: float, now_s: float, jump_rad: float) -> float | None:
        """Record a steering command; return the one on the other side that it has recently replaced, None without one.

        jump_rad: angle by which the wheels can turn before the car responds; a smaller change of side is mere steering.
        """
        if now_s - self._wished_s > LAST_WISH_S:
            self._since_s = now_s
        elif self._wish_rad * steering_rad < 0.0 and abs(steering_rad - self._wish_rad) > jump_rad:
            if now_s - self._since_s >= MEANT_S:
                self._given_up_rad, self._until_s = self._wish_rad, now_s + WAVERS_S
            self._since_s = now_s
        self._wish_rad, self._wished_s = steering_rad, now_s
        wavers = now_s < self._until_s and self._given_up_rad * steering_rad < 0.0
        return self._given_up_rad if wavers else None
