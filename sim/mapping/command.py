"""`wallride map`: the map of a recorded lap, with its verdict, as files of ROS and a picture."""

import argparse
import json
import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Final

from wallride.runtime.host.output_files import write_answer, write_files
from wallride.runtime.map_files import ABOUT, walls_text
from wallride.sim.mapping.closing import ClosedLap, close_lap
from wallride.sim.mapping.lap_record import LapRecord, read_record, wheel_words
from wallride.sim.mapping.map_output import map_files, path_of, save_picture
from wallride.sim.mapping.raster import rasterized
from wallride.sim.mapping.verdict import MapVerdict, judge_map
from wallride.sim.mapping.walls import walls_of
from wallride.sim.recordings import RecordingError

REFUSED: Final = 1
"""Exit code of a map that is not to be trusted; its files are written all the same, to look at."""


def run(options: argparse.Namespace) -> int:
    """Write the map; RecordingError for what the user can correct."""
    record = read_record(options.file, options.topic)
    lap = close_lap(record)
    verdict = judge_map(record, lap, is_open=options.open)
    stem = _stem(options.output, options.file)
    if not verdict.good and _is_good(stem):
        stem = stem.with_name(f"{stem.name}-refused")
    _check_own(stem)
    raster, path = rasterized(lap.frames, lap.poses, record.kind[1]), path_of(record, lap)
    scale = lap.car.scale if len(record.reports) else None
    about = f"{ABOUT}{record.name}, {verdict.words}"
    walls = walls_text(walls_of(lap, raster), scale, about)
    files = map_files(stem, raster, path, walls, about, record.world)
    title = f"{record.name}: {verdict.way_m:.1f} m, {'good' if verdict.good else 'refused'}"
    files[stem.with_name(f"{stem.name}.png")] = lambda file: save_picture(file, raster, path, lap, title)
    write_files(files)
    told = {
        **asdict(verdict), "scale": lap.car.scale, "trim_rad": lap.car.trim_rad,
        "map": str(stem.with_name(f"{stem.name}.yaml")),
    }  # fmt: skip
    told = {key: None if isinstance(one, float) and not math.isfinite(one) else one for key, one in told.items()}
    write_answer(json.dumps(told) + "\n", options.json)
    if options.json != "-":
        written = f"written: {', '.join(map(str, files))}"
        for line in (*summary(record, lap, verdict), written, f"verdict: {verdict.words}", *advice(verdict)):
            print(line)  # noqa: T201 - this is the command's answer
    return 0 if verdict.good else REFUSED


def summary(record: LapRecord, lap: ClosedLap, verdict: MapVerdict) -> Iterator[str]:
    """Yield the figures in sentences."""
    yield f"{record.name}: {verdict.way_m:.1f} m in {verdict.keyframes} keyframes, by {_origin(record)}"
    yield (
        f"scans lie {1000 * verdict.residual_m:.1f} mm beside each other (rms), at least"
        f" {100 * verdict.inliers:.0f} % of their points fit at 95 % of the places"
    )
    if verdict.loops:
        yield (
            f"the loop is closed by {verdict.loops} edges, {verdict.full_loops} of them in all directions"
            f" (chi2 {verdict.contradiction:.2f})"
        )
    if len(record.reports):
        yield wheel_words(lap.car.scale) + _trim(record, lap)


def advice(verdict: MapVerdict) -> Iterator[str]:
    """Yield what to do about a refused map."""
    if not verdict.good:
        calm = ", on a computer that is not busy" if verdict.may_be_a_busy_computer else ""
        yield f"drive the lap again{calm}; docs/racing.md says what each reason asks for"


def _origin(record: LapRecord) -> str:
    if not len(record.reports):
        return "the scans alone, without wheels"
    return "wheels and gyro" if len(record.gyro) else "wheels and steering, without a gyro"


def _trim(record: LapRecord, lap: ClosedLap) -> str:
    return "" if len(record.gyro) else f"; the wheels' true angle is the reported one {lap.car.trim_rad:+.3f} rad"


def _is_good(stem: Path) -> bool:
    """Tell whether a good map has that name already, which a refused one does not replace."""
    return _first_line(stem).endswith(", good")


def _check_own(stem: Path) -> None:
    """Raise RecordingError where a file of another program has the name of one that would be written."""
    if _first_line(stem).startswith(f"# {ABOUT}"):
        return
    others = (stem.with_name(stem.name + ending) for ending in (".yaml", ".pgm", ".png"))
    if other := next((file for file in others if file.exists()), None):
        raise RecordingError(
            f"{other} is there, and not from `wallride map`: name another map with -o, or move it away"
        )


def _first_line(stem: Path) -> str:
    """Return the first line of a map's file, "" where there is none."""
    try:
        with stem.with_name(f"{stem.name}.yaml").open(encoding="utf-8", errors="replace") as file:
            return file.readline().rstrip()
    except OSError:
        return ""


def _stem(output: Path | None, recording: Path) -> Path:
    """Return the path of the map's files without their endings."""
    if output is None:
        return Path(recording.stem)
    return output.with_suffix("") if output.suffix in {".yaml", ".yml", ".pgm"} else output
