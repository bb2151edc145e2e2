"""`benchmarks.lab recordings`: perception and safety on real recordings: noise, window, braking, needless stops.

Most recordings lack the car's odometry; its motion is estimated from the scans (`wallride.sim.recordings.scans`).
"""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.lab.recorded.episodes import episodes
from benchmarks.lab.recorded.first_scan import first_offsets_m
from benchmarks.lab.recorded.reenact import reenact, run_at_wall
from benchmarks.lab.recorded.replay import Replay, jumps, noise, replay
from wallride.sim.lab.cell import Cell, CellChoice, Experiment, Figures, TabledCell
from wallride.sim.lab.figures import Row, number, text
from wallride.sim.recordings import RecordingError, load_recording
from wallride.sim.recordings.scans import better_side, is_foreign

MOVES_ABOVE_MPS = 0.3
_SHORTER = (
    (" beams around ", " at "),
    (" see the car itself, or dirt, and are ignored", " car or dirt"),
    (" are dirty: clean the window", " DIRTY"),
    (" see nothing: uncover or clean the window", " BLIND"),
)
ENDINGS = (".npz", ".bag", ".db3", ".mcap")
NEARBY = ("data/racecar", "data/originals", "shared/data/racecar", "shared/data/originals")


class NoRecordingsError(Exception):
    """There are none to judge; the text says what to give."""


def named_or_nearby(folder: Path | None) -> tuple[str, ...]:
    """Return the recordings of a folder, or else of those nearby; NoRecordingsError without any."""
    if folder is not None:
        if not folder.exists():
            raise NoRecordingsError(f"{folder} does not exist; give a folder of recordings, or one recording")
        found = recordings_in(folder)
        if not found:
            raise NoRecordingsError(f"{folder}: there is no {', '.join(ENDINGS)} in it")
        return found
    for place in (Path.cwd(), *Path(__file__).resolve().parents):
        found = tuple(path for name in NEARBY for path in recordings_in(place / name))
        if found:
            return found
    raise NoRecordingsError("there are no recordings in data/racecar nearby; give the folder that holds them")


def recordings_in(folder: Path) -> tuple[str, ...]:
    """Return the paths of all possible recordings in a folder or below it; a file is itself."""
    if folder.is_file():
        return (str(folder),)
    return tuple(str(path) for path in sorted(folder.rglob("*")) if path.suffix in ENDINGS)


def cells(choice: CellChoice) -> list[Cell]:
    """Return one cell per recording; `scenario` is its path."""
    paths = choice.recordings[:3] if choice.quick else choice.recordings
    return [Cell("benchmarks.lab.recordings", path, "ball+swept", 0.0, 0.8, "left", 0) for path in paths]


def run(cell: Cell) -> Replay:
    """Judge one recording."""
    recording = load_recording(Path(cell.scenario))
    return replay(recording, better_side(recording))


def measure(cell: Cell) -> Figures:
    """Judge one recording; "skipped" holds the reason if that is impossible."""
    try:
        recording = load_recording(Path(cell.scenario))
    except RecordingError as error:
        return {"skipped": str(error)}
    if is_foreign(recording):
        return {"skipped": "scans of several lidars on one topic: their stamps run backwards"}
    return judge(replay(recording, better_side(recording)))


def judge(done: Replay) -> Figures:
    """Return the figures of one recording."""
    distance_m, heading_rad = _wall(done)
    follower_m = np.array([judged.distance_m for judged in done.judged])
    moves = np.array([judged.motor.speed_mps > MOVES_ABOVE_MPS for judged in done.judged])
    which = np.ones_like(moves) if done.motion.stands else moves
    found = [asdict(episode) for episode in episodes(done)]
    at_wall = run_at_wall(done)
    first_line_off_m, first_off_m = first_offsets_m(done)
    return {
        "skipped": None,
        "name": done.recording.name,
        "scans": len(done.judged),
        "stands": done.motion.stands,
        "way_m": number(done.motion.way_m[-1]),
        "fastest_mps": number(done.motion.speed_mps.max()),
        "asked_by": done.judged[0].asked.origin,
        "driving_scans": sum(judged.drives for judged in done.judged),
        "side": done.side,
        "wall_seen_share": number(np.isfinite(distance_m).mean()),
        "wall_m": _spread(distance_m),
        "wall_heading_rad": _spread(heading_rad),
        "wall_noise_m": number(noise(np.where(which, distance_m, np.nan))),
        "wall_jumps": jumps(distance_m[which]),
        "follower_noise_m": number(noise(np.where(which, follower_m, np.nan))),
        "follower_off_m": _median((follower_m - distance_m)[which]),
        "first_line_off_m": number(first_line_off_m),
        "first_off_m": number(first_off_m),
        "walker_scans": sum(judged.walker for judged in done.judged),
        "dirty_beams": int(np.count_nonzero(done.masked)),
        "words": list(done.health.words),
        "episodes": [{name: _plain(value) for name, value in episode.items()} for episode in found],
        "stops": sum(episode["stop"] for episode in found),
        "needless_stops": sum(episode["stop"] and episode["outcome"] == "passed" for episode in found),
        "at_wall": {name: _plain(value) for name, value in asdict(at_wall).items()} if at_wall else None,
        "reenacted": [_plain_all(asdict(braking)) for braking in reenact(done, at_wall)] if at_wall else [],
    }


def _wall(done: Replay) -> tuple[np.ndarray[Any, np.dtype[np.float64]], np.ndarray[Any, np.dtype[np.float64]]]:
    lines = [judged.line for judged in done.judged]
    return (
        np.array([line.distance_m if line is not None else np.nan for line in lines]),
        np.array([line.heading_rad if line is not None else np.nan for line in lines]),
    )


def _median(values: np.ndarray[Any, np.dtype[np.float64]]) -> float | None:
    finite = values[np.isfinite(values)]
    return number(np.median(finite)) if finite.size else None


def _spread(values: np.ndarray[Any, np.dtype[np.float64]]) -> list[float | None] | None:
    """Return (lowest, 1 %, median, 99 %, highest)."""
    finite = values[np.isfinite(values)]
    return [number(value) for value in np.percentile(finite, [0, 1, 50, 99, 100])] if finite.size else None


def _plain(value: object) -> object:
    return number(value) if isinstance(value, float) else value


def _plain_all(values: dict[str, Any]) -> dict[str, Any]:
    return {name: _plain(value) for name, value in values.items()}


def tables(rows: Sequence[Row]) -> list[TabledCell]:
    """Return the tables of the noise and window, of safety's interferences, and of the runs at a wall."""
    judged = _told_apart([row for row in rows if not row["skipped"]])
    skipped = tuple(f"skipped {Path(row['scenario']).name}: {row['skipped']}" for row in rows if row["skipped"])
    return [_seen(judged, skipped), _interfered(judged), _at_walls(judged)]


def _seen(rows: Sequence[Row], notes: tuple[str, ...]) -> TabledCell:
    lines = tuple(
        (
            row["name"],
            "stands" if row["stands"] else f"{row['way_m']:.1f} m, {row['fastest_mps']:.1f} m/s",
            f"{row['side']}, {100 * row['wall_seen_share']:.0f} %",
            "-" if row["wall_m"] is None else f"{row['wall_m'][1]:.3f} .. {row['wall_m'][3]:.3f}",
            _mm(row["wall_noise_m"]),
            str(row["wall_jumps"]),
            f"{_mm(row['follower_noise_m'])}, {_mm(row['follower_off_m'])}",
            f"{_mm(row['first_off_m'])} ({_mm(row['first_line_off_m'])})",
            str(row["walker_scans"]),
            "; ".join(_briefly(words) for words in row["words"]) or "clean",
        )
        for row in rows
    )
    columns = (
        "recording", "car", "wall", "distance 1..99 % [m]", "noise mm", "jumps", "follower: noise, off mm",
        "first scan off (its line) mm", "walkers", "window",
    )  # fmt: skip
    return TabledCell("what the car would have seen", columns, lines, notes)


def _briefly(words: str) -> str:
    """Shorten a sentence about the window to the width of a column."""
    for long, short in _SHORTER:
        words = words.replace(long, short)
    return words


def _mm(value_m: float | None) -> str:
    return text(float("nan") if value_m is None else 1000 * value_m, 1)


def _interfered(rows: Sequence[Row]) -> TabledCell:
    lines = tuple(
        (
            row["name"],
            f"{episode['first']}..{episode['last']}",
            "stop" if episode["stop"] else f"<= {episode['allowed_mps']:.2f} m/s",
            episode["reason"],
            f"{episode['speed_mps']:.2f}",
            _or_dash(episode["way_m"]),
            episode["outcome"] + (f" ({episode['room_m']:.2f} m)" if episode["room_m"] is not None else ""),
        )
        for row in rows
        for episode in row["episodes"]
    )
    stops, needless = (sum(row[name] for row in rows) for name in ("stops", "needless_stops"))
    drives = [row for row in rows if row["driving_scans"] and not row["stands"]]
    note = (
        f"{stops} stops in {len(drives)} drives ({sum(row['driving_scans'] for row in drives)} scans told to go),"
        f" {needless} before which the real car passed"
    )
    columns = ("recording", "scans", "safety", "reason", "m/s", "way m", "the real car (nearest)")
    return TabledCell("where safety would have interfered", columns, lines, (note,))


def _told_apart(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with names that differ: of files of one stem the whole name, of those of one name the folder."""
    names = [row["name"] for row in rows]
    for longer in (lambda path: path.name, lambda path: f"{path.parent.name}/{path.name}"):
        shared = {name for name in names if names.count(name) > 1}
        names = [
            longer(Path(row["scenario"])) if name in shared else name for name, row in zip(names, rows, strict=True)
        ]
    return [{**row, "name": name} for name, row in zip(names, rows, strict=True)]


def _or_dash(value: float | None) -> str:
    return text(float("nan") if value is None else value, 2)


def _at_walls(rows: Sequence[Row]) -> TabledCell:
    lines = []
    for row in rows:
        if row["at_wall"] is None:
            continue
        real = row["at_wall"]
        lines.append(
            (row["name"], "really", str(real["braked_scan"]), _at(real["braked_gap_m"], real["braked_mps"]), "-",
             _or_dash(real["rest_m"]), "")
        )  # fmt: skip
        lines += [
            (
                "", f"swept, mu {run['mu']:g}", str(run["slower_scan"]), _at(run["slower_gap_m"], run["slower_mps"]),
                _at(run["braked_gap_m"], run["braked_mps"]), _or_dash(run["rest_m"]),
                f"{run['needs_m']:.2f}" + (f", hits at {run['impact_mps']:.2f} m/s" if run["impact_mps"] else ""),
            )
            for run in row["reenacted"]
        ]  # fmt: skip
    columns = ("recording", "who", "slows at scan", "there", "full brake", "rests at m", "physics needs m")
    return TabledCell("runs at a wall: gaps of the bumper", columns, tuple(lines))


def _at(gap_m: float | None, speed_mps: float | None) -> str:
    """Return place and speed; a run that met no wall has no gap."""
    if gap_m is None and speed_mps is None:
        return "-"
    gap = "at no wall" if gap_m is None else f"{gap_m:.2f} m"
    return gap if speed_mps is None else f"{gap}, {speed_mps:.2f} m/s"


def plot(folder: Path, cell: Cell, figures: Figures) -> None:
    """Draw every interference, and the window if it has a finding."""
    if figures["skipped"]:
        return
    from benchmarks.lab.recorded.recording_pictures import save_episode, save_window

    done = run(cell)
    for place, episode in enumerate(episodes(done)):
        save_episode(folder, done, place, episode)
    if done.health.words:
        save_window(folder, done)


EXPERIMENT = Experiment(measure, cells, tables, plot)
