"""What a follower or a safety law answers: the shape that every method shares."""

import math
from typing import Protocol

from drivers.api import Drive, MotorState, Scan
from drivers.value import value
from runtime.arbitration.command import SafetyAssessment, Verdict

__all__ = ["Follower", "Guard", "Guidance", "SafetyAssessment", "Verdict"]


@value()
class Guidance:
    """A follower's answer to one scan.

    drive: None when the method cannot tell where to go; the car then stops, with `reason` as the reason.
    distance_m, error_m: distance to the followed wall and that minus the desired one; NaN without a wall.
    angle_rad: heading of the fitted line seen from the car, positive when it leads to the left; NaN without one.
    line_m: distance of that line from the rear axle; NaN where the method fits none or steers by the nearest points.
    """

    drive: Drive | None
    distance_m: float
    error_m: float
    angle_rad: float
    reason: str
    line_m: float = math.nan


class Follower(Protocol):
    """A way to follow a wall."""

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan; called once for each, in order."""
        ...


class Guard(Protocol):
    """A way to judge how fast the car may go, independent of the driving source."""

    def look(self, scan: Scan, motor: MotorState | None) -> SafetyAssessment:
        """Take in one scan; called once for each, in order. The outlook then judges every drive until the next."""
        ...

    def learn(self) -> None:
        """Do now what else was to be done with the last scan, once its answer is on the wire; else `look` does it."""
        ...
