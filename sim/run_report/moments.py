"""Data of the page's script: lines, scans and decisions of a run, small enough to be mailed.

Numbers are little-endian base64. A scan is at most 181 groups of beams; of each group the nearest beam is kept, as
13 bits of centimetres (0: no return) and 3 bits that say which beam of the group it was.
"""

import base64
import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.runtime.telemetry.screen_words import because
from wallride.sim.replay.drive_log import LoggedMessage, decode
from wallride.sim.replay.figures import at_time
from wallride.sim.replay.run import MuxChange, RecordedRun
from wallride.sim.run_report.charts import ChartLine
from wallride.sim.world.pose import Floats

MAX_POINTS = 6000
"""Maximum number of points of a line; a longer one keeps the lowest and the highest of every piece."""
MAX_SCANS, MIN_SCAN_GAP_S = 1200, 0.1
"""Maximum number of scans at a steady rate, and their minimum gap; those of the decisions come in addition."""
MAX_DECISION_SCANS = 200
MAX_GROUPS, MAX_IN_GROUP = 181, 8
GROUP_SHIFT, MAX_CM = 13, (1 << 13) - 1
MAX_PATH = 3000


def moments(run: RecordedRun, laps_s: Sequence[float] = ()) -> dict[str, Any]:
    """Return the script's data of a run at each moment. laps_s: when each lap was complete."""
    car = run.settings.car
    return {
        "name": run.name,
        "races": run.settings.wall_follow.method == "line",
        "duration": round(run.duration_s, 3),
        "car": [car.front_m, car.rear_m, car.half_width_m, car.lidar_x_m, car.lidar_y_m],
        "decisions": [_decision(change) for change in run.changes],
        "laps": [round(end_s, 2) for end_s in laps_s],
        "path": _path(run),
        "scans": _scans(run),
    }


def chart(
    lines: Sequence[ChartLine], unit: str, marks: Sequence[Any], band: tuple[float, float] | None
) -> dict[str, Any]:
    """Return the script's data of one chart."""
    return {
        "unit": unit,
        "lines": [_line(line) for line in lines if np.isfinite(line.value).any()],
        "marks": [[round(mark.time_s, 3), mark.text] for mark in marks],
        "band": band,
    }


def _line(line: ChartLine) -> dict[str, Any]:
    keep = extremes(line.value, MAX_POINTS)
    return {
        "label": line.label, "short": line.short or line.label, "style": line.style,
        "t": _packed(line.time_s[keep], "<f4"), "v": _packed(line.value[keep], "<f4"),
    }  # fmt: skip


def extremes(value: Floats, most: int) -> npt.NDArray[np.intp]:
    """Return indices (at most `most`), ascending: all, or the lowest and the highest of every piece of equal length.

    A piece with a value that is not finite keeps the first of those, so that gaps stay gaps.
    """
    if value.size <= most:
        return np.arange(value.size)
    kept: set[int] = {0, value.size - 1}
    for piece in np.array_split(np.arange(value.size), (most - 2) // 3):
        part = value[piece]
        finite = np.isfinite(part)
        if finite.any():
            kept |= {int(piece[finite][part[finite].argmin()]), int(piece[finite][part[finite].argmax()])}
        if not finite.all():
            kept.add(int(piece[(~finite).argmax()]))
    return np.array(sorted(kept), dtype=np.intp)


def _decision(change: MuxChange) -> list[object]:
    speeds = [round(speed, 3) if math.isfinite(speed) else None for speed in (change.asked_mps, change.allowed_mps)]
    words = because(change.reason, change.measure)
    return [round(change.time_s, 3), change.winner, words, change.driver, *speeds, change.delivered]


def _path(run: RecordedRun) -> dict[str, str]:
    path = run.path
    keep = np.unique(np.linspace(0, max(len(path.time_s) - 1, 0), MAX_PATH).astype(np.intp))[: len(path.time_s)]
    names = {"t": path.time_s, "x": path.x_m, "y": path.y_m, "yaw": path.yaw_rad}
    return {name: _packed(column[keep], "<f4") for name, column in names.items()}


def _scans(run: RecordedRun) -> dict[str, Any]:
    chosen = [run.scans[at] for at in chosen_scans([time_s for time_s, _ in run.scans], run)]
    if not chosen:
        return {"t": "", "pose": "", "beams": "", "groups": 0}
    path = run.path
    poses = np.array(
        [
            [at_time(path.time_s, column, time_s) for column in (path.x_m, path.y_m, path.yaw_rad)]
            for time_s, _ in chosen
        ]
    )
    first = decode(chosen[0][1])
    beams = np.asarray(first.ranges).size
    group = min(MAX_IN_GROUP, max(1, math.ceil(beams / MAX_GROUPS)))
    rows = [packed_scan(message, beams, group) for _, message in chosen]
    return {
        "t": _packed(np.array([time_s for time_s, _ in chosen]), "<f4"),
        "pose": _packed(np.nan_to_num(poses).ravel(), "<f4"),
        "beams": _packed(np.concatenate(rows), "<u2"),
        "groups": rows[0].size,
        "group": group,
        "from": float(first.angle_min),
        "step": float(first.angle_increment),
    }


def chosen_scans(times_s: Sequence[float], run: RecordedRun) -> list[int]:
    """Return the scans to show: at a steady rate, and the one behind each decision."""
    gap_s = max(MIN_SCAN_GAP_S, run.duration_s / MAX_SCANS)
    kept, next_s = set(), -math.inf
    for at, time_s in enumerate(times_s):
        if time_s >= next_s - 1e-3:
            kept.add(at)
            next_s = time_s + gap_s
    if times_s:
        behind = [max(0, bisect_left(times_s, change.time_s + 1e-6) - 1) for change in run.changes]
        kept |= set(behind[:MAX_DECISION_SCANS])
    return sorted(kept)


def packed_scan(message: LoggedMessage, beams: int, group: int) -> npt.NDArray[np.uint16]:
    """Return a scan's groups (ceil(beams / group),): centimetres of the nearest beam, and its number in the group."""
    scan = decode(message)
    ranges_m = np.asarray(scan.ranges, np.float64)[:beams]
    known = (ranges_m >= scan.range_min) & (ranges_m <= scan.range_max)
    groups = math.ceil(beams / group)
    table = np.full(groups * group, np.inf)
    table[: ranges_m.size] = np.where(known, ranges_m, np.inf)
    rows = table.reshape(groups, group)
    which = rows.argmin(axis=1)
    nearest_m = rows[np.arange(groups), which]
    seen = np.isfinite(nearest_m)
    centimetres = np.where(seen, np.clip(np.rint(100 * np.where(seen, nearest_m, 0.0)), 1, MAX_CM), 0)
    packed: npt.NDArray[np.uint16] = centimetres.astype(np.uint16)
    packed |= which.astype(np.uint16) << np.uint16(GROUP_SHIFT)
    return packed


def _packed(values: npt.NDArray[Any], kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
