"""Comparison of two decisions, recorded and replayed: differences beyond rounding, as values and sentences."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields

from wallride.runtime.arbitration.command import NO_WINNER, Output, Source
from wallride.runtime.control.guidance import Guidance

ROUNDING = 1e-9
"""Tolerance of rounding: another computer, or one without the compiled laws, rounds sines and sums differently."""
CLOSE = 0.02
"""Tolerance for a recording that begins in the middle: metres, m/s, rad. The laws' memory before it is unknown."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One value that differs between recording and replay.

    time_s: since the decision log began. scan: sequence number of the newest scan. what: such as "steering".
    """

    time_s: float
    scan: int
    what: str
    recorded: object
    replayed: object

    def sentence(self) -> str:
        """Return the difference as a sentence."""
        values = f"recorded {_text(self.recorded)}, replayed {_text(self.replayed)}"
        return f"scan {self.scan}, {self.time_s:.3f} s: {self.what}: {values}"


def outputs(recorded: Output, replayed: Output, allowed: float = 0.0) -> Iterator[tuple[str, object, object]]:
    """Yield the differences between two decisions: name, recorded, replayed; the most significant first."""
    was, now = recorded.decision, replayed.decision
    pairs: list[tuple[str, object, object]] = [
        ("winner", was.winner, now.winner),
        ("driver", was.driver, now.driver),
        ("reason", was.reason, now.reason),
        ("allowed speed [m/s]", was.speed_mps, now.speed_mps),
        ("steering [rad]", was.steering_rad, now.steering_rad),
        ("brake [m/s2]", was.brake_mps2, now.brake_mps2),
        ("measure", was.measure, now.measure),
        ("speed sent [m/s]", recorded.drive.speed_mps, replayed.drive.speed_mps),
        ("steering sent [rad]", recorded.drive.steering_rad, replayed.drive.steering_rad),
        ("brake sent [m/s2]", recorded.drive.brake_mps2, replayed.drive.brake_mps2),
    ]
    yield from (pair for pair in pairs if not same(pair[1], pair[2], allowed))


def guidances(recorded: Guidance, replayed: Guidance, allowed: float = 0.0) -> Iterator[tuple[str, object, object]]:
    """Yield the differences between two answers of the follower."""
    if (recorded.drive is None) != (replayed.drive is None):
        yield "the follower's drive", recorded.drive, replayed.drive
    elif recorded.drive is not None and replayed.drive is not None:
        for name, unit in (("speed_mps", "m/s"), ("steering_rad", "rad")):
            pair = getattr(recorded.drive, name), getattr(replayed.drive, name)
            if not same(*pair, allowed):
                yield f"the follower's {name.partition('_')[0]} [{unit}]", *pair
    for column in fields(Guidance):
        if column.name not in {"drive", "promise"}:
            pair = getattr(recorded, column.name), getattr(replayed, column.name)
            if not same(*pair, allowed):
                yield f"the follower's {column.name.partition('_')[0]}", *pair


def same(recorded: object, replayed: object, allowed: float = 0.0) -> bool:
    """Return whether two values are equal: numbers but for rounding, or within `allowed`; NaN equals NaN."""
    if isinstance(recorded, int | float) and isinstance(replayed, int | float):
        if math.isnan(recorded) or math.isnan(replayed):
            return math.isnan(recorded) and math.isnan(replayed)
        return recorded == replayed or abs(recorded - replayed) <= max(allowed, ROUNDING)
    return recorded == replayed


def _text(value: object) -> str:
    if isinstance(value, Source):
        return str(value)
    if value is None:
        return NO_WINNER
    return f"{value!r}" if isinstance(value, str | float) else str(value)
