"""What was driven in a scenario, by the simulator's truth; and whether its expectations hold."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import ge, gt, lt
from typing import Any

import numpy as np

from wallride.drivers.api import Drive
from wallride.sim.figures.summary import Sample
from wallride.sim.scenario.scenario_file import Scenario
from wallride.sim.scenario.scenario_parts import ScenarioExpectation
from wallride.sim.world.obstacles import LIDAR_AHEAD_M, Obstacle, ObstacleWorld
from wallride.sim.world.pose import Booleans, Floats, Pose

STANDS_BELOW_MPS, DRIVES_ABOVE_MPS = 0.05, 0.25
REACHED_M = 3.0
"""An obstacle that never came nearer to the car plays no part in the scenario."""


@dataclass(slots=True)
class DrivenScenario:
    """Record of a drive, one entry per sample in each list.

    contact_mps: speed at the first contact, None without. reasons: of the decisions; empty where they are not known.
    laps_s: duration of each lap. nearest_m: least distance of each obstacle that appeared. In virtual time also
    navigation: every distinct reason of a driver's command, in order; window: the last sentences about the lidar's
    window; way_m: driven so far; wire: (time, drive) of every command that the motor took; law_fault: of the user's.
    """

    time_s: list[float] = field(default_factory=list)
    pose: list[Pose] = field(default_factory=list)
    speed_mps: list[float] = field(default_factory=list)
    wall_m: list[float] = field(default_factory=list)
    clearance_m: list[float] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    laps_s: list[float] = field(default_factory=list)
    contact_mps: float | None = None
    nearest_m: dict[Obstacle, float] = field(default_factory=dict)
    navigation: list[str] = field(default_factory=list)
    window: tuple[str, ...] = ()
    way_m: float = 0.0
    wire: list[tuple[float, Drive]] = field(default_factory=list)
    law_fault: str = ""

    def note(self, sample: Sample, scene: ObstacleWorld) -> None:
        """Note a sample, and how near the obstacles are."""
        car = Pose(sample.x_m, sample.y_m, sample.yaw_rad)
        self.time_s.append(sample.time_s)
        self.pose.append(car)
        self.speed_mps.append(sample.speed_mps)
        self.wall_m.append(sample.wall_m)
        self.clearance_m.append(sample.clearance_m)
        for obstacle, away_m in scene.distances_m(sample.time_s, car.ahead(LIDAR_AHEAD_M)).items():
            near_m = max(0.0, away_m - obstacle.half_length_m)
            self.nearest_m[obstacle] = min(near_m, self.nearest_m.get(obstacle, math.inf))

    def speed_at(self, time_s: float) -> float:
        """Return the true speed at a time."""
        return self.speed_mps[min(len(self.speed_mps) - 1, max(0, int(np.searchsorted(self.time_s, time_s))))]

    def stood_s(self, from_s: float) -> float:
        """Return the first time of standstill after a time, infinity if never."""
        return self._first_s(from_s, lambda speed_mps: abs(speed_mps) < STANDS_BELOW_MPS)

    def went_s(self, from_s: float) -> float:
        """Return the first time of forward motion after a time, infinity if never."""
        return self._first_s(from_s, lambda speed_mps: speed_mps > DRIVES_ABOVE_MPS)

    def _first_s(self, after_s: float, holds: Callable[[float], bool]) -> float:
        pairs = zip(self.time_s, self.speed_mps, strict=True)
        return next((at_s for at_s, speed_mps in pairs if at_s > after_s and holds(speed_mps)), math.inf)


@dataclass(frozen=True, slots=True)
class JudgedExpectation:
    """An expectation of a line. holds: None where the drive does not tell. words: the measured result."""

    line: int
    holds: bool | None
    words: str


def judge(scenario: Scenario, driven: DrivenScenario) -> list[JudgedExpectation]:
    """Return whether each expectation holds."""
    window = _Windows(driven, scenario.settings.wall_follow.desired_distance_m)
    return [
        JudgedExpectation(scenario.text.line_of(("expect", index)), *_judged(expected, window))
        for index, expected in enumerate(scenario.content.expect)
    ]


def mistakes_after(scenario: Scenario, driven: DrivenScenario) -> list[str]:
    """Return the mistakes that only a drive shows, with file and line: obstacles that the car never reached."""
    found = []
    for index, obstacle in enumerate(scenario.obstacles):
        near_m = driven.nearest_m.get(obstacle)
        if near_m is None or near_m > REACHED_M:
            how = "never appeared" if near_m is None else f"was never nearer than {near_m:.1f} m to the lidar"
            kind = scenario.content.obstacle[index].kind
            words = f"obstacle never reached: this {kind} {how}; change its place or moment, or the duration"
            found.append(str(scenario.text.mistake(("obstacle", index), words)))
    return found


class _Windows:
    """The arrays of a drive, and their parts between two times."""

    def __init__(self, driven: DrivenScenario, desired_m: float) -> None:
        self.driven = driven
        self.time_s = np.array(driven.time_s)
        self.speed_mps = np.abs(np.array(driven.speed_mps))
        self.error_m = np.array(driven.wall_m) - desired_m
        self.clearance_m = np.array(driven.clearance_m)

    def within(self, expected: ScenarioExpectation) -> Booleans:
        """Return which samples lie between the times of an expectation."""
        until_s = math.inf if expected.until_s is None else expected.until_s
        return np.asarray((self.time_s >= expected.after_s) & (self.time_s <= until_s))

    def first_s(self, expected: ScenarioExpectation, holds: Booleans) -> float:
        """Return the time from after_s to the first sample in the window that holds; infinity if none does."""
        index = np.flatnonzero(self.within(expected) & holds)
        return float(self.time_s[index[0]] - expected.after_s) if index.size else math.inf

    def way_m(self, expected: ScenarioExpectation) -> float:
        """Return the way driven in the window."""
        inside = self.within(expected)
        places = np.array([(at.x_m, at.y_m) for at in self.driven.pose]).reshape(-1, 2)[inside]
        return float(np.hypot(*np.diff(places, axis=0).T).sum())


_Judgement = tuple[bool | None, str]
_Judge = Callable[[ScenarioExpectation, _Windows], _Judgement]


def _judged(expected: ScenarioExpectation, window: _Windows) -> _Judgement:
    if not window.within(expected).any():
        return False, f"{_wanted(expected)}: the drive ended before"
    holds, words = JUDGES[expected.condition](expected, window)
    return holds, f"{_wanted(expected)}: {words}"


def _wanted(expected: ScenarioExpectation) -> str:
    """Return an expectation as a line of text."""
    value = getattr(expected, expected.condition)
    shown = str(value).lower() if isinstance(value, bool) else repr(value) if isinstance(value, str) else f"{value:g}"
    times = f" after {expected.after_s:g} s" if expected.after_s else ""
    times += "" if expected.until_s is None else f" until {expected.until_s:g} s"
    return f"{expected.condition} = {shown}{times}"


def _contact(expected: ScenarioExpectation, window: _Windows) -> _Judgement:
    touched = window.driven.contact_mps
    words = "touched nothing" if touched is None else f"touched something at {touched:.2f} m/s"
    return (touched is not None) == expected.contact, words


def _fastest_mps(expected: ScenarioExpectation, window: _Windows) -> float:
    return float(window.speed_mps[window.within(expected)].max())


def _stands(expected: ScenarioExpectation, window: _Windows) -> _Judgement:
    fastest_mps = _fastest_mps(expected, window)
    return (fastest_mps < STANDS_BELOW_MPS) == expected.stands, f"at most {fastest_mps:.2f} m/s"


def _soon(verb: str, holds: Callable[[Floats], Booleans]) -> _Judge:
    """Return what judges the time until a speed holds."""

    def judge(expected: ScenarioExpectation, window: _Windows) -> _Judgement:
        after_s = window.first_s(expected, holds(window.speed_mps))
        words = f"{verb} after {after_s:.2f} s" if math.isfinite(after_s) else f"never {verb}"
        return after_s <= getattr(expected, expected.condition), words

    return judge


def _error(figure: Callable[[Floats], Any]) -> _Judge:
    """Return what judges a figure of the error over the samples that have a wall."""

    def judge(expected: ScenarioExpectation, window: _Windows) -> _Judgement:
        error_m = np.abs(window.error_m[window.within(expected)])
        error_m = error_m[np.isfinite(error_m)]
        if not error_m.size:
            return False, "no wall was there to follow"
        return bool(figure(error_m) < getattr(expected, expected.condition)), f"{figure(error_m):.3f} m"

    return judge


def _bounded(
    figure: Callable[[ScenarioExpectation, _Windows], float], holds: Callable[[float, float], bool], words: str
) -> _Judge:
    """Return what compares a figure with the expected value. words: show the figure."""

    def judge(expected: ScenarioExpectation, window: _Windows) -> _Judgement:
        found = figure(expected, window)
        return holds(found, getattr(expected, expected.condition)), words.format(found)

    return judge


def _lap_time(expected: ScenarioExpectation, window: _Windows) -> _Judgement:
    laps_s = window.driven.laps_s
    best_s = min(laps_s, default=math.inf)
    return best_s < (expected.lap_below_s or 0.0), f"{best_s:.2f} s" if laps_s else "no lap"


def _reason(expected: ScenarioExpectation, window: _Windows) -> _Judgement:
    if not window.driven.reasons:
        return None, "not known in this drive"
    inside = np.flatnonzero(window.within(expected))
    said: Sequence[str] = list(dict.fromkeys(window.driven.reasons[index] for index in inside))
    return any(one.startswith(expected.reason or "") for one in said), "; ".join(said)


JUDGES: dict[str, _Judge] = {
    "contact": _contact,
    "stands": _stands,
    "stands_within_s": _soon("stood", lambda speed_mps: speed_mps < STANDS_BELOW_MPS),
    "drives_within_s": _soon("drove", lambda speed_mps: speed_mps > DRIVES_ABOVE_MPS),
    "mean_error_below_m": _error(np.mean),
    "max_error_below_m": _error(np.max),
    "clearance_above_m": _bounded(
        lambda expected, window: float(window.clearance_m[window.within(expected)].min()), gt, "at least {:.3f} m"
    ),
    "speed_below_mps": _bounded(_fastest_mps, lt, "at most {:.2f} m/s"),
    "mean_speed_above_mps": _bounded(
        lambda expected, window: float(window.speed_mps[window.within(expected)].mean()), gt, "{:.2f} m/s"
    ),
    "way_above_m": _bounded(lambda expected, window: window.way_m(expected), gt, "{:.3f} m"),
    "laps_at_least": _bounded(lambda _, window: len(window.driven.laps_s), ge, "{} laps"),
    "lap_below_s": _lap_time,
    "reason": _reason,
}
"""For each condition of an expectation, what judges it."""
