"""`wallride pose`: where a recorded drive was on a map, scan by scan, as a file, a picture and figures."""

import argparse
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from wallride.runtime.control.localization.localizer import Whereabouts
from wallride.runtime.host.output_files import Content, write_answer, write_files
from wallride.runtime.map_files import ABOUT, WALLS_SUFFIX, CarMap, MapError, read_map
from wallride.sim.figures.tum import SUFFIX, tum_text
from wallride.sim.mapping.lap_record import LapRecord, own_log, read_record, record_of_log, wheel_words
from wallride.sim.mapping.own_poses import line_of, own_poses
from wallride.sim.mapping.poses import PoseTrack, track, track_of
from wallride.sim.racing.line_file import empty_picture
from wallride.sim.racing.ring import driven_path
from wallride.sim.recordings import RecordingError
from wallride.sim.world.map_file import read_occupancy
from wallride.sim.world.pose import Floats

NOT_TRUSTED: Final = 1
"""Exit code of a drive that was not found on the map, or so badly that the map is not of that place."""
LEAST_LOCATED, LEAST_FITS, MOST_LOSSES = 0.5, 0.7, 2
"""Least shares of the scans that are not ambiguous, and of their beams, and the most losses: a drive on its map has 1,
0.98 and none, with people over half of the view 0.6 of the beams at times; on another map 0.1 to 0.8, 0.6 and ten."""
MAP_SUFFIXES: Final = (".yaml", ".yml")
SHOWN_CM: Final = 10.0
"""Standard deviation from which on the picture's colour is the same."""
COLUMNS: Final = ("t_s", "x_m", "y_m", "yaw_rad", "std_m", "fits", "whereabouts")


def run(options: argparse.Namespace) -> int:
    """Find the poses and write them; RecordingError for what the user can correct."""
    if options.file.suffix in MAP_SUFFIXES and options.map.suffix not in MAP_SUFFIXES:
        raise RecordingError(f"the recording comes first: wallride pose {options.map} {options.file}")
    try:
        known = read_map(options.map, read_occupancy)
    except MapError as error:
        raise RecordingError(str(error)) from error
    log = own_log(options.file)
    record = record_of_log(log) if log is not None else read_record(options.file, options.topic)
    own = own_poses(log, known, line_of(log, options.map)) if log is not None and not options.anywhere else None
    if own is not None and own.found:  # by the very scans and reports that it had, and not as it would be found anew
        found = track_of(own.found, record)
    else:
        found = track(record, known, None if options.anywhere else known.start)
    told = figures(found, _of_the_map(record, options.map))
    told["reasons"] = list(reasons_against(told))
    if own is not None:
        told |= {"own_poses": own.recorded, "own_poses_same": own.same}
    output: Path = options.output or Path(f"{options.file.stem}.pose.csv")
    picture = output.with_suffix(".png")
    files: dict[Path, Content] = {
        output: text_of(found, f"pose by wallride of {record.name} on {known.name}"),
        picture: lambda file: save_picture(file, known, found, f"{record.name} on {known.name}"),
    }
    if options.tum:
        files[output.with_suffix(SUFFIX)] = _trajectory(found, record.unix_s + float(record.scan_s[0]))
    write_files(files)
    write_answer(json.dumps(told) + "\n", options.json)
    if options.json != "-":
        against = "; ".join(told["reasons"])
        verdict = f"doubtful: {against}. Is the map of this place, as it is now?" if against else "good"
        written = ", ".join(map(str, files))
        for line in (*summary(record, known, found, told), f"written: {written}", f"verdict: {verdict}"):
            print(line)  # noqa: T201 - this is the command's answer
    return 0 if not told["reasons"] else NOT_TRUSTED


def figures(found: PoseTrack, path: Floats | None) -> dict[str, Any]:
    """Return the figures of a drive by name. path: (n, 4) time [s] and pose of the map's lap, if it is this drive."""
    located = found.located
    told: dict[str, Any] = {
        "scans": len(found.estimates), "located": int(located.sum()),
        "ambiguous": sum(one.whereabouts is Whereabouts.AMBIGUOUS for one in found.estimates),
        "way_m": round(found.way_m, 2),
        "losses_s": [round(time_s, 2) for time_s in found.losses_s], "scale": round(found.scale, 4),
    }  # fmt: skip
    if located.any():
        std_m, share = (
            np.array([getattr(one, name) for one in found.estimates])[located] for name in ("std_m", "share")
        )
        told |= {
            "std_m": round(float(np.median(std_m)), 4), "largest_std_m": round(float(std_m.max()), 4),
            "fits": round(float(np.nanmedian(share)), 3), "fits_p1": round(float(np.nanpercentile(share, 1)), 3),
        }  # fmt: skip
    if path is not None and located.any():
        there = np.interp(path[:, 0], found.time_s, found.poses[:, 0] + 1j * found.poses[:, 1])
        off_m = np.abs(there - (path[:, 1] + 1j * path[:, 2]))
        told |= {
            "off_path_rms_m": round(float(np.sqrt(np.nanmean(off_m**2))), 4),
            "off_path_p99_m": round(float(np.nanpercentile(off_m, 99)), 4),
        }  # fmt: skip
    return told


def summary(record: LapRecord, known: CarMap, found: PoseTrack, told: dict[str, Any]) -> Iterator[str]:
    """Yield the figures in sentences."""
    scans, located = told["scans"], told["located"]
    yield f"{record.name} on {known.name}: located at {located} of {scans} scans, {told['way_m']:.1f} m of way"
    if not located:
        yield from _nowhere(found)
        return
    yield (
        f"{100 * told['fits']:.0f} % of the beams fit the map (median; 1 % of scans: at most"
        f" {100 * told['fits_p1']:.0f} %); the position is known to {100 * told['std_m']:.1f} cm in the median, to"
        f" {100 * told['largest_std_m']:.0f} cm at worst"
    )
    if len(record.reports):
        yield wheel_words(told["scale"])
    if told["losses_s"]:
        yield f"lost at {', '.join(f'{time_s:.1f} s' for time_s in told['losses_s'])}"
    if "own_poses" in told:
        same, recorded = told["own_poses_same"], told["own_poses"]
        yield (
            f"the car's own {recorded} poses are found again to the bit"
            if same == recorded
            else f"of the car's own {recorded} poses {same} are found again to the bit: another map or another"
            " version; the file has those of now"
        )
    if "off_path_rms_m" in told:
        yield (
            f"off the path of the map, which is of this drive: {100 * told['off_path_rms_m']:.1f} cm rms,"
            f" {100 * told['off_path_p99_m']:.1f} cm at 99 % of its places"
        )


def reasons_against(told: dict[str, Any]) -> Iterator[str]:
    """Yield what speaks against the poses of a drive, by its figures."""
    known = told["scans"] - told["ambiguous"]  # a map that looks alike from two places may well be the right one
    if not told["located"] or told["located"] < LEAST_LOCATED * known:
        yield f"located at {told['located']} of {told['scans']} scans"
    if told.get("fits", 1.0) < LEAST_FITS:
        yield f"only {100 * told['fits']:.0f} % of the beams fit"
    if len(told["losses_s"]) > MOST_LOSSES:
        yield f"lost {len(told['losses_s'])} times"


def text_of(found: PoseTrack, about: str) -> str:
    """Return the file: a row for each scan, NaN where the car was not located."""
    rows = (
        f"{time_s:.4f}; {one.x_m:.4f}; {one.y_m:.4f}; {one.yaw_rad:.5f}; {one.std_m:.4f}; {one.share:.3f};"
        f" {one.whereabouts}"
        for time_s, one in zip(found.time_s.tolist(), found.estimates, strict=True)
    )
    return "\n".join([f"# {about}", f"# {'; '.join(COLUMNS)}", *rows, ""])


def save_picture(file: IO[bytes], known: CarMap, found: PoseTrack, title: str) -> None:
    """Write a picture of the map's walls with the poses, coloured by how exactly they are known."""
    figure, axes = empty_picture()
    field = known.field
    shades = np.where(field.free.reshape(field.rows, field.columns), 1.0, 0.85)
    x_m, y_m = field.corner_m.real, field.corner_m.imag
    extent = (x_m, x_m + field.cell_m * field.columns, y_m, y_m + field.cell_m * field.rows)
    axes.imshow(shades, cmap="gray", vmin=0.0, vmax=1.0, origin="lower", extent=extent)
    axes.imshow(
        np.ma.masked_less(field.nearness.reshape(field.rows, field.columns), 0.9), cmap="gray_r", vmin=0.0, vmax=1.0,
        origin="lower", extent=extent,
    )  # fmt: skip
    std_cm = np.array([100 * one.std_m for one in found.estimates])
    drawn = axes.scatter(found.poses[:, 0], found.poses[:, 1], c=std_cm, s=5, cmap="viridis", vmin=0.0, vmax=SHOWN_CM)
    first = int(np.argmax(found.located))
    heading_deg = math.degrees(found.poses[first, 2]) - 90.0 if found.located.any() else 0.0
    axes.plot(found.poses[first, 0], found.poses[first, 1], marker=(3, 0, heading_deg), color="tab:red", markersize=12)
    figure.colorbar(drawn, label="standard deviation of the position [cm]")
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    figure.savefig(file, dpi=120)


def _trajectory(found: PoseTrack, begin_s: float) -> str:
    return tum_text(
        (begin_s + time_s, *pose) for time_s, pose in zip(found.time_s.tolist(), found.poses.tolist(), strict=True)
    )


def _nowhere(found: PoseTrack) -> Iterator[str]:
    last = found.estimates[-1]
    if last.whereabouts is Whereabouts.AMBIGUOUS:
        places = ", ".join(f"({x_m:.1f} m, {y_m:.1f} m, {math.degrees(yaw):.0f} deg)" for x_m, y_m, yaw in last.alike)
        yield f"these places look alike, and nothing decides between them: {places}"
    else:
        yield "the scans fit no place of the map: is it another building, or scaled wrongly?"


def _of_the_map(record: LapRecord, map_file: Path) -> Floats | None:
    """Return time and poses of the map's lap, (n, 4), if the map is of this drive."""
    walls, path = map_file.with_name(map_file.stem + WALLS_SUFFIX), driven_path(map_file)
    if path is None or not walls.is_file():
        return None
    with path.open(encoding="utf-8", errors="replace") as file:
        if not file.readline().startswith(f"# {ABOUT}{record.name}, "):
            return None
    rows = np.loadtxt(path, delimiter=";", ndmin=2)
    return rows[:, :4]
