"""A driver that steers to the one side and then suddenly to the other has not made up its mind, and may turn again.

A free arc lets a car drive at a wall for which it could not stop any more, because it is about to turn away from it.
That holds for a driver who does turn. One who has just jumped from one side to the other (the followed wall joins
another one in this scan and not in the next; a thumb on a joystick) may jump back when it is too late for a stop. So
for a moment the way that was given up counts as well as the one wished now: not with a stop, which would take the
steering away from a driver who means it, but with the graded limit, so that a stop is possible when it does turn back.
"""

import math
from dataclasses import dataclass

WAVERS_S = 0.3
"""The servo needs 0.21 s from one end to the other, the car's answer 0.07 s: by then it drives where it was steered."""
MEANT_S = 0.1
"""What was wished for a shorter time was an error of a scan or two: the car has not gone there."""
LAST_WISH_S = 0.3
"""An older wish was given up long ago, or was another source's."""


@dataclass(slots=True)
class SteeringReversal:
    """Small state: the wish and since when it is on this side, and the side that was given up."""

    _wish_rad: float = math.nan
    _wished_s: float = -math.inf
    _since_s: float = -math.inf
    _given_up_rad: float = math.nan
    _until_s: float = -math.inf

    def given_up_rad(self, steering_rad: float, now_s: float, jump_rad: float) -> float | None:
        """Take in a wish; return the one on the other side that it has lately been changed for, None without one.

        jump_rad: what the wheels can turn before the car answers at all; who changes sides by less is only steering.
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
