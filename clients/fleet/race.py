"""Positions, gaps and lap times of several cars. Pure: time is an argument."""

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from wallride.clients.fleet.lap_timer import LapTime, LapTimer, RacePose, StartLine

STANDS_S = 3.0
SILENT_S = 1.0
MAX_CARS = 64
MAX_NUMBER = 1e9
"""Bound of stamps [s], places [m] and angles [rad]: no car has more, and sums of them stay finite."""


class Order(StrEnum):
    """What decides the position: laps and the time of the last one, or the best lap."""

    LAPS = "laps"
    BEST = "best"


@dataclass(frozen=True, slots=True)
class Standing:
    """One car's place.

    position: 1 is first. last_s, best_s: lap times, None before the first. gap_s: behind the first car at the line, or
    more where it is later already; in the order of best laps, the difference of these. laps_down: whole laps behind;
    gap_s is None then. unseen: laps whose end was not observed. note: what keeps it, "" while it drives.
    """

    position: int
    car: str
    laps: int
    last_s: float | None
    best_s: float | None
    gap_s: float | None
    laps_down: int
    unseen: int
    note: str

    def fields(self) -> dict[str, Any]:
        """Return plain values."""
        return asdict(self)


class RaceControl:
    """Follows every car that is heard; lines: by car, each in that car's odometry frame, "" for all others."""

    def __init__(self, lines: Mapping[str, StartLine] | None = None) -> None:
        self._lines = dict(lines or {})
        self._timers: dict[str, LapTimer] = {}

    def begin(self) -> None:
        """Begin a new race: lines without two points are where the cars stand when they are heard next."""
        self._timers.clear()

    def take(self, car: str, status: Mapping[str, Any], arrival_s: float) -> None:
        """Take a car's status; one without a readable pose is left out."""
        sample = _sample(status)
        if sample is None or (car not in self._timers and len(self._timers) >= MAX_CARS):
            return
        if car not in self._timers:
            self._timers[car] = LapTimer(self._lines.get(car, self._lines.get("")))
        self._timers[car].take(sample, arrival_s)

    def standings(self, now_s: float, order: Order = Order.LAPS) -> list[Standing]:
        """Return the cars, the first one first."""
        key = _by_laps if order is Order.LAPS else _by_best
        ranked = sorted(self._timers.items(), key=lambda one: (key(one[1]), one[0]))
        first = ranked[0][1].laps if ranked else []
        return [self._standing(k + 1, car, timer, first, now_s, order) for k, (car, timer) in enumerate(ranked)]

    def _standing(
        self, position: int, car: str, timer: LapTimer, first: Sequence[LapTime], now_s: float, order: Order
    ) -> Standing:
        laps, best_s = timer.laps, _best_s(timer.laps)
        down, gap_s = _behind(laps, first, now_s) if order is Order.LAPS else (0, _slower_s(best_s, _best_s(first)))
        return Standing(
            position, car, len(laps), laps[-1].took_s if laps else None, best_s, gap_s, down,
            sum(not lap.seen for lap in laps), _note(timer, now_s),
        )  # fmt: skip


def _by_laps(timer: LapTimer) -> tuple[float, ...]:
    began_s = timer.began_s if timer.began_s is not None else math.inf
    return -len(timer.laps), timer.laps[-1].at_s if timer.laps else began_s


def _by_best(timer: LapTimer) -> tuple[float, ...]:
    best_s = _best_s(timer.laps)
    return (best_s if best_s is not None else math.inf, *_by_laps(timer))


def _best_s(laps: Sequence[LapTime]) -> float | None:
    return min((lap.took_s for lap in laps if lap.seen), default=None)


def _slower_s(best_s: float | None, leading_s: float | None) -> float | None:
    return best_s - leading_s if best_s is not None and leading_s is not None else None


def _behind(laps: Sequence[LapTime], first: Sequence[LapTime], now_s: float) -> tuple[int, float | None]:
    """Return whole laps and time behind the first car; the time goes on while the car does not come round."""
    done = len(laps)
    if laps is first or not first:
        return 0, 0.0 if laps else None
    ends_s = [lap.at_s for lap in first]
    at_line = bisect_right(ends_s, laps[-1].at_s) - done if laps else 0
    down = max(0, at_line, len(first) - done - 1)
    if down or not laps:
        return down, None
    gap_s = laps[-1].at_s - ends_s[done - 1]
    return 0, max(gap_s, now_s - ends_s[done]) if len(first) > done else gap_s


def _note(timer: LapTimer, now_s: float) -> str:
    if now_s - timer.heard_s > SILENT_S:
        return f"not heard for {now_s - timer.heard_s:.0f} s"
    if timer.began_s is None:
        return "has not started"
    if now_s - timer.moved_s > STANDS_S:
        return f"stands for {now_s - timer.moved_s:.0f} s"
    return "its odometry began anew" if timer.restarts else ""


def _sample(status: Mapping[str, Any]) -> RacePose | None:
    try:
        odom = status["odom"]
        numbers = [float(one) for one in (status["stamp_s"], odom["x_m"], odom["y_m"], odom["yaw_rad"])]
    except (KeyError, OverflowError, TypeError, ValueError):
        return None
    if not all(abs(one) < MAX_NUMBER for one in numbers):  # NaN is not smaller either
        return None
    return RacePose(str(status.get("session") or ""), *numbers)
