"""Figures of a run, as simulator and car measure: `wallride.sim.summary` and `wallride.runtime.control.score`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wallride.runtime.arbitration.command import NO_WINNER
from wallride.runtime.control.perception.geometry import directions
from wallride.runtime.control.score import Score
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.figures.summary import OF_THE_WALL, Sample, figures, rounded
from wallride.sim.replay.drive_log import LoggedMessage, decode
from wallride.sim.replay.run import MuxChange, RecordedRun
from wallride.sim.world.pose import Floats

TOGETHER_S = 1e-3
"""Maximum time between two messages of one decision."""
MIN_STOP_S = 0.05
SAME_SCAN_S = 0.02
NEAREST_COUNT = 3
"""Rank of the beam that counts as the nearest: two nearer ones may be dust."""
CAPS = frozenset({"safety", "e-stop", "permit"})


@dataclass(frozen=True, slots=True)
class RecordedStop:
    """A commanded stop of the car, after a command to move. until_s: NaN to the end of the run.

    speed_mps: speed at the command. also: later reasons during the same stop.
    """

    from_s: float
    until_s: float
    winner: str
    reason: str
    measure: float
    speed_mps: float
    also: tuple[str, ...]


def numbers(run: RecordedRun) -> dict[str, Any]:
    """Return all figures as plain values: the output of `wallride report --json` and of the page.

    Those of `wallride.sim.summary` use the car's estimates (odometry, its own distance to the wall), not the truth.
    """
    score = Score()
    for time_s, error_m in zip(run.error.time_s, run.error.value, strict=True):
        score.add(float(error_m), at_time(run.path.time_s, run.path.speed_mps, float(time_s)))
    found = stops(run)
    status = run.status
    races = run.settings.wall_follow.method == "line"
    driven = figures(samples(run), run.settings.wall_follow.desired_distance_m)
    return {
        "name": run.name,
        "car": run.car,
        "method": run.settings.wall_follow.method,
        "side": run.settings.wall_follow.side,
        "desired_distance_m": run.settings.wall_follow.desired_distance_m,
        "scans": len(run.scans),
        **{name: value for name, value in driven.items() if not (races and name in OF_THE_WALL)},
        **(_laps(run) if races else {}),
        "duration_s": round(run.duration_s, 4),
        "top_speed_mps": rounded(float(np.abs(run.path.speed_mps).max())) if len(run.path.speed_mps) else None,
        "distance_error": {"mean_abs_m": rounded(score.mean_abs_m, 6), "rms_m": rounded(score.rms_m, 6)},
        "stops": len(found),
        "faults": [{"time_s": round(time_s, 3), "words": fault.words} for time_s, fault in run.faults],
        "standing_s": round(sum((_end(stop, run) - stop.from_s) for stop in found), 2),
        "scan_to_motor_ms": dict(status.get("scan_to_motor_ms") or {}),
        "winners": {name: round(float(s), 2) for name, s in (status.get("seconds_by_winner") or {}).items()},
    }


def _laps(run: RecordedRun) -> dict[str, Any]:
    """Return the laps along the line as the car's status told them, and how far from it the last one was."""
    told = [race for _, fields in run.statuses if (race := (fields.get("pose") or {}).get("race"))]
    newest = {race["laps"]: race for race in told if race["laps"]}
    last = newest[max(newest)] if newest else {}
    return {
        "laps": max(newest, default=0),
        "lap_times_s": [round(race["time_s"], 3) for _, race in sorted(newest.items())],
        **_sectors([race for _, race in sorted(newest.items())]),
        "line_rms_m": last.get("rms_m"),
        "line_largest_m": last.get("largest_m"),
    }


def _sectors(laps: Sequence[Mapping[str, Any]]) -> dict[str, list[float]]:
    """Return the times of each part of the laps by name, "sector_1_s" and so on; nothing where none were told."""
    told = [lap.get("sectors_s") or () for lap in laps]
    if not told or len(set(map(len, told))) > 1:  # of a car that did not time them yet
        return {}
    parts = zip(*told, strict=True)
    return {f"sector_{number}_s": [round(time_s, 3) for time_s in part] for number, part in enumerate(parts, 1)}


def samples(run: RecordedRun) -> list[Sample]:
    """Return the car's estimated state at every scan that was answered."""
    desired_m = run.settings.wall_follow.desired_distance_m
    path, rows = run.path, []
    nearest = _clearances(run)
    for number, time_s in enumerate(run.error.time_s):
        at = min(max(int(np.searchsorted(path.time_s, time_s, side="right")) - 1, 0), len(path.time_s) - 1)
        if at < 0:
            break
        error_m = float(run.error.value[number])
        wall_m = error_m + desired_m if math.isfinite(error_m) else math.inf
        clearance_m = _nearest_value(*nearest, float(time_s))
        x_m, y_m, yaw_rad, speed_mps = (
            float(column[at]) for column in (path.x_m, path.y_m, path.yaw_rad, path.speed_mps)
        )
        rows.append(Sample(float(time_s), x_m, y_m, yaw_rad, speed_mps, wall_m, clearance_m))
    return rows


def stops(run: RecordedRun) -> list[RecordedStop]:
    """Return every stop, in order: its source, and the reason."""
    found: list[RecordedStop] = []
    moved, began = False, math.nan
    for time_s, sent_mps in zip(run.sent.time_s, run.sent.value, strict=True):
        if sent_mps != 0:
            if not math.isnan(began):
                _add_stop(found, run, began, float(time_s))
            moved, began = True, math.nan
        elif moved and math.isnan(began):
            began = float(time_s)
    if not math.isnan(began):
        _add_stop(found, run, began, math.nan)
    return found


def _add_stop(found: list[RecordedStop], run: RecordedRun, from_s: float, until_s: float) -> None:
    if until_s - from_s < MIN_STOP_S:  # False for NaN
        return
    why = newest_change(run, from_s)
    end_s = until_s if math.isfinite(until_s) else math.inf
    later = [change.reason for change in run.changes if from_s + TOGETHER_S < change.time_s < end_s - TOGETHER_S]
    also = tuple(dict.fromkeys(reason for reason in later if why is None or reason != why.reason))
    speed_mps = at_time(run.path.time_s, run.path.speed_mps, from_s)
    if why is None:
        found.append(RecordedStop(from_s, until_s, NO_WINNER, "not recorded", math.nan, speed_mps, also))
    else:
        found.append(RecordedStop(from_s, until_s, why.winner, why.reason, why.measure, speed_mps, also))


def slowed(run: RecordedRun) -> list[MuxChange]:
    """Return the decisions from which on a cap made the car slower without stopping it."""
    return [change for change in run.changes if change.winner in CAPS and change.allowed_mps != 0]


def newest_change(run: RecordedRun, time_s: float) -> MuxChange | None:
    """Return the decision in force at a time."""
    before = [change for change in run.changes if change.time_s <= time_s + TOGETHER_S]
    return before[-1] if before else None


def at_time(times_s: Floats, values: Floats, time_s: float) -> float:
    """Return the newest value at a time, NaN before the first."""
    index = int(np.searchsorted(times_s, time_s + TOGETHER_S, side="right")) - 1
    return float(values[index]) if index >= 0 else math.nan


def points(message: LoggedMessage, car: CarSettings) -> tuple[Floats, Floats]:
    """Return a scan's points (n,), (n,) in base_link; beams without a distance are left out."""
    scan = decode(message)
    ranges_m = np.asarray(scan.ranges, np.float64)
    rays = directions(float(scan.angle_min), float(scan.angle_increment), ranges_m.size)
    known = (ranges_m >= scan.range_min) & (ranges_m <= scan.range_max)  # False for NaN
    return rays[0][known] * ranges_m[known] + car.lidar_x_m, rays[1][known] * ranges_m[known] + car.lidar_y_m


def _clearances(run: RecordedRun) -> tuple[Floats, Floats]:
    """Return times and the clearance of the outline then; the car's own parts do not count."""
    car = run.settings.car
    rows: Floats = np.full((len(run.scans), 2), np.inf)
    for row, (time_s, message) in zip(rows, run.scans, strict=True):
        x_m, y_m = points(message, car)
        ahead_m = np.maximum(np.maximum(x_m - car.front_m, -car.rear_m - x_m), 0.0)
        aside_m = np.maximum(np.abs(y_m) - car.half_width_m, 0.0)
        gap_m = np.hypot(ahead_m, aside_m)
        gap_m = gap_m[gap_m > 0]
        row[0] = time_s
        if gap_m.size >= NEAREST_COUNT:
            row[1] = np.partition(gap_m, NEAREST_COUNT - 1)[NEAREST_COUNT - 1]
    return rows[:, 0], rows[:, 1]


def _nearest_value(times_s: Floats, values: Floats, time_s: float) -> float:
    """Return the value at the time that is nearest, infinity if none is near."""
    after = int(np.searchsorted(times_s, time_s))
    near = [at for at in (after - 1, after) if 0 <= at < len(times_s) and abs(times_s[at] - time_s) < SAME_SCAN_S]
    return float(values[min(near, key=lambda at: abs(times_s[at] - time_s))]) if near else math.inf


def _end(stop: RecordedStop, run: RecordedRun) -> float:
    return stop.until_s if math.isfinite(stop.until_s) else run.duration_s


def truth_of(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a summary of `wallride sim --json` that stands beside the car's own figures."""
    names = (
        "distance_m", "mean_abs_error_m", "rms_error_m", "settle_s", "max_overshoot_m", "min_clearance_m",
        "mean_speed_mps", "laps", "lap_times_s", "line_rms_m", "line_largest_m", "trajectory_rms_m",
        "trajectory_largest_m", "collided", "world", "began_unix_s",
    )  # fmt: skip
    return {name: summary[name] for name in names if name in summary}
