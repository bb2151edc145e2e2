"""Follower with recovery: it calls the driver first, and backs out when the safety has boxed the car in."""

from collections.abc import Callable
from dataclasses import replace

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.guidance import Follower, Guidance
from wallride.runtime.control.recovery.way_out import HELP, TRAFFIC, Recovery
from wallride.runtime.control.safety.swept import SweptGuard


class RecoveringFollower:
    """Wraps a follower; its manoeuvres are commands like any other, judged by safety and outranked by the human.

    believed: whether the odometry is good enough to back out by; where it is not, the way out is not tried.
    """

    def __init__(
        self, follower: Follower, guard: SweptGuard, recovery: Recovery, believed: Callable[[], bool] = lambda: True
    ) -> None:
        self._follower = follower
        self._guard = guard
        self._recovery = recovery
        self._believed = believed

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Return the follower's guidance for one scan, or the way out with its text as the reason."""
        guidance = self._follower.follow(scan, motor)
        assessment = self._guard.assessment  # safety runs first: it is this scan's
        if assessment is None or assessment.view.scan is not scan:
            return guidance
        believed, toward_rad = self._believed(), guidance.toward_rad
        advice = self._recovery.step(assessment, guidance.drive, motor, believed=believed, toward_rad=toward_rad)
        if advice.drive is None and not advice.words:
            return guidance
        stuck = advice.words in {HELP, TRAFFIC}
        promise = guidance.promise if advice.drive is None else None
        return replace(
            guidance, drive=advice.drive or guidance.drive, reason=advice.words, stuck=stuck, promise=promise
        )
