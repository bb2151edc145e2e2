"""What a follower or a safety law answers: the shape that every method shares."""

from dataclasses import dataclass
from typing import Protocol

from drivers.api import Drive, MotorState, Scan


@dataclass(frozen=True, slots=True)
class Guidance:
    """A follower's answer to one scan.

    drive: None when the method cannot tell where to go; the car then stops, with `reason` as the reason.
    distance_m, error_m: distance to the followed wall and that minus the desired one; NaN without a wall.
    angle_rad: heading of the wall seen from the car, positive when the wall leads to the left; NaN without a wall.
    """

    drive: Drive | None
    distance_m: float
    error_m: float
    angle_rad: float
    reason: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """Safety's answer to one scan: ceilings on the speed, infinity being consent.

    reason: constant words; measure: the number behind them (metres of free way), NaN where there is none.
    """

    forward_mps: float
    reverse_mps: float
    reason: str
    measure: float


class Follower(Protocol):
    """A way to follow a wall."""

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan; called once for each, in order."""
        ...


class Guard(Protocol):
    """A way to judge how fast the car may go."""

    def judge(self, scan: Scan, motor: MotorState | None) -> Verdict:
        """Answer one scan; called once for each, in order."""
        ...
