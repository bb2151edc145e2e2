"""Interfaces of followers and safety laws, shared by every method."""

import math
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Drive, MotorState, Scan
from wallride.drivers.value import value
from wallride.runtime.arbitration.command import SafetyAssessment, Verdict
from wallride.runtime.arbitration.promise import Promise

__all__ = ["Follower", "Guard", "Guidance", "Promise", "SafetyAssessment", "Verdict"]


@value()
class Guidance:
    """A follower's answer to one scan.

    drive: None when the method has no direction; the car then stops, with `reason` as the reason.
    distance_m, error_m: distance to the followed wall and that minus the desired one; NaN without a wall. By `line`:
    NaN and how far left of the race line the car is.
    angle_rad: heading of the fitted line seen from the car, positive when it leads to the left; NaN without one.
    line_m: distance of that line from the rear axle; NaN where the method fits none or steers by the nearest points.
    stuck: whether there is no way out of where the car stands; `reason` says what it needs.
    promise: the path that the method will drive, for safety to judge; None where it promises none.
    toward_rad: bearing in which the way goes on where the car has to turn to it first, for recovery; NaN elsewhere.
    """

    drive: Drive | None
    distance_m: float
    error_m: float
    angle_rad: float
    reason: str
    line_m: float = math.nan
    stuck: bool = False
    promise: Promise | None = None
    toward_rad: float = math.nan


class Follower(Protocol):
    """Interface of a law that follows a wall."""

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan; called once for each, in order."""


class Driver(Follower, Protocol):
    """A follower of the table of laws."""

    @property
    def path_m(self) -> npt.NDArray[np.float64] | None:
        """Return the path that it plans, (2, k) in base_link, for drawings; None where it plans none."""
        return None

    @property
    def figures(self) -> Mapping[str, Any]:
        """Return laps and errors along a race line; nothing where it drives none."""
        return {}

    def tune(self, settings: Any) -> None:  # noqa: ANN401 - each law has its own
        """Change the settings and keep the state."""


class Guard(Protocol):
    """Interface of a law that limits the car's speed, independent of the driving source."""

    def look(self, scan: Scan, motor: MotorState | None) -> SafetyAssessment:
        """Process one scan; called once for each, in order. The assessment judges every drive until the next."""

    def learn(self) -> None:
        """Run the deferred work of the last scan, once its answer is on the wire; else `look` runs it."""
