"""Speeds in the settings at which the motor does not turn."""

from collections.abc import Iterator

from wallride.drivers.section import Section
from wallride.runtime.settings.tree import Settings

SPEEDS = (
    "wall_follow.speed_mps", "safety.creep_mps", "safety.slowest_mps", "safety.doubtful_mps", "safety.reverse_mps",
    "safety.recovery.speed_mps", "joystick.max_speed_mps", "car.max_speed_mps",
)  # fmt: skip
"""Settings that are sent to the motor as a speed; 0 of one of them is a stop that is meant."""


def too_slow_to_turn(settings: Settings) -> tuple[str, ...]:
    """Return a warning for each speed below the motor's slowest."""
    slowest_mps = settings.motor.min_speed_mps
    return tuple(
        f"{name} = {speed_mps:g} m/s is less than motor.min_speed_mps = {slowest_mps:g} m/s:"
        " the motor does not turn at it"
        for name, speed_mps in _speeds(settings)
        if 0.0 < speed_mps < slowest_mps
    )


def _speeds(settings: Settings) -> Iterator[tuple[str, float]]:
    for name in SPEEDS:
        value: object = settings
        for part in name.split("."):
            value = getattr(value, part, None) if isinstance(value, Section) else None
        if isinstance(value, float):
            yield name, value
