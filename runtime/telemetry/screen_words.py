"""Format of reasons and angles on every screen: with units, steering in degrees. Files and topics keep SI units."""

import math
from collections.abc import Sequence

MIN_SHOWN_M = 0.005
STRAIGHT_RAD = math.radians(0.5)
AGE_REASONS: Sequence[str] = ("the scan is",)
"""Reasons that are followed by an age [s]; all others are followed by a free distance [m]."""


def because(reason: str, measure: float | None) -> str:
    """Return a reason with its measure and unit; without the measure where that would read as 0."""
    if measure is None or not math.isfinite(measure):
        return reason
    if reason.startswith(tuple(AGE_REASONS)):
        return f"{reason}, {measure:.2f} s"
    return reason if abs(measure) < MIN_SHOWN_M else f"{reason}, {measure:.2f} m free"


def times(count: int) -> str:
    """Return "once" or "3 times"."""
    return "once" if count == 1 else f"{count} times"


def steering_words(steering_rad: float | None) -> str:
    """Return a steering angle as "12° left"; "" for None or NaN."""
    if steering_rad is None or not math.isfinite(steering_rad):
        return ""
    if abs(steering_rad) < STRAIGHT_RAD:
        return "straight"
    return f"{math.degrees(abs(steering_rad)):.0f}° {'left' if steering_rad > 0 else 'right'}"
