"""Output of the readers, in the recorder's absolute time, and assembly of a recording from it.

The beams of other lidars are put into the order of a car's: counter-clockwise, each once, ahead in the middle.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from wallride.sim.recordings.recording import (
    CommandTrack,
    Floats,
    LidarTrack,
    OdometryTrack,
    Recording,
    RecordingError,
    plain_name,
)

MIN_TURN_STEPS = 8
"""Beams of a full turn from which on there is something to roll."""


@dataclass(slots=True)
class Tracks:
    """All tracks that a reader found in one file, by plain topic name; times are seconds since 1970."""

    lidars: dict[str, LidarTrack] = field(default_factory=dict)
    commands: dict[str, CommandTrack] = field(default_factory=dict)
    odometries: dict[str, OdometryTrack] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def assemble(name: str, tracks: Tracks, topic: str | None) -> Recording:
    """Choose one lidar and put everything on the zero of its first scan.

    topic: the lidar wanted, with or without slashes; None takes the one named "scan", else the one with the most
        scans (the first by name among equals), and notes the others.

    Raises:
        RecordingError: the file holds no scan, or none on the topic wanted.
    """
    lidar = _chosen(name, tracks, topic)
    others = tuple(sorted(other.topic for other in tracks.lidars.values() if other is not lidar))
    notes = list(tracks.notes)
    if others and topic is None:
        notes.append(f"{name} holds {len(others) + 1} lidars: {lidar.topic} is played, not {', '.join(others)}.")
    _check_beams(name, lidar)
    lidar, turned = ahead_in_the_middle(lidar)
    notes += turned
    order = np.argsort(lidar.received_s, kind="stable")
    zero_s = float(lidar.received_s[order[0]])
    return Recording(
        name=name,
        topic=lidar.topic,
        other_topics=others,
        received_s=_fixed(lidar.received_s[order] - zero_s),
        stamp_s=_fixed(lidar.stamp_s[order] - zero_s),
        ranges_m=_fixed_ranges(lidar.ranges_m, order),
        angle_min_rad=lidar.angle_min_rad,
        angle_step_rad=lidar.angle_step_rad,
        range_min_m=lidar.range_min_m,
        range_max_m=lidar.range_max_m,
        scan_time_s=lidar.scan_time_s,
        commands=MappingProxyType({key: _shifted(track, zero_s) for key, track in sorted(tracks.commands.items())}),
        odometry=_chosen_odometry(tracks.odometries, zero_s),
        notes=tuple(notes),
    )


def _chosen(name: str, tracks: Tracks, topic: str | None) -> LidarTrack:
    if not tracks.lidars:
        found = sorted([*tracks.commands, *tracks.odometries])
        held = f"it holds {', '.join(found)}" if found else "it holds neither commands nor odometry either"
        lost = "".join(f" {note}" for note in tracks.notes)
        raise RecordingError(f"{name} holds no LaserScan ({held}): choose a recording with a lidar.{lost}")
    if topic is not None:
        wanted = tracks.lidars.get(plain_name(topic))
        if wanted is None:
            lidars = ", ".join(sorted(lidar.topic for lidar in tracks.lidars.values()))
            raise RecordingError(f"{name} holds no lidar topic {topic}: choose one of {lidars}.")
        return wanted
    return min(tracks.lidars.items(), key=lambda item: (item[0] != "scan", -len(item[1].received_s), item[0]))[1]


def _check_beams(name: str, lidar: LidarTrack) -> None:
    """Refuse a lidar whose beams point nowhere in particular."""
    numbers = (lidar.angle_min_rad, lidar.angle_step_rad, lidar.range_min_m, lidar.range_max_m)
    if not all(map(math.isfinite, numbers)) or lidar.angle_step_rad == 0:
        raise RecordingError(
            f"{name}: the beams of {lidar.topic} begin at {numbers[0]} rad in steps of {numbers[1]} rad, within"
            f" {numbers[2]} to {numbers[3]} m: these are not the numbers of a lidar."
        )


def _chosen_odometry(odometries: dict[str, OdometryTrack], zero_s: float) -> OdometryTrack | None:
    if not odometries:
        return None
    track = min(odometries.items(), key=lambda item: (-len(item[1]), item[0]))[1]
    values = (track.x_m, track.y_m, track.yaw_rad, track.vx_mps, track.vy_mps, track.wz_radps)
    return OdometryTrack(_fixed(track.received_s - zero_s), *(_fixed(value) for value in values))


def _shifted(track: CommandTrack, zero_s: float) -> CommandTrack:
    return CommandTrack(_fixed(track.received_s - zero_s), _fixed(track.speed_mps), _fixed(track.steering_rad))


def _fixed(values: Floats) -> Floats:
    fixed = np.array(values, dtype=np.float64)
    fixed.setflags(write=False)
    return fixed


def _fixed_ranges(ranges_m: npt.NDArray[np.float32], order: npt.NDArray[np.intp]) -> npt.NDArray[np.float32]:
    fixed = ranges_m[order]
    fixed.setflags(write=False)
    return fixed


def columns(rows: Sequence[Sequence[float]] | Floats, width: int) -> list[Floats]:
    """Return the columns of a table of numbers of `width` columns, which may have no rows."""
    table = np.asarray(rows, dtype=np.float64).reshape(-1, width)
    return [table[:, column] for column in range(width)]


def ahead_in_the_middle(lidar: LidarTrack) -> tuple[LidarTrack, list[str]]:
    """Return the lidar with its beams from right to left, and a note of what was done, [] for nothing."""
    notes = []
    if lidar.angle_step_rad < 0:
        last_rad = lidar.angle_min_rad + (lidar.ranges_m.shape[1] - 1) * lidar.angle_step_rad
        lidar = _with(lidar, lidar.ranges_m[:, ::-1], last_rad, -lidar.angle_step_rad)
        notes.append("its beams turn clockwise and are reversed")
    turn = round(math.tau / lidar.angle_step_rad)
    if turn < MIN_TURN_STEPS:
        return lidar, []
    if (more := lidar.ranges_m.shape[1] - turn) > 0:
        lidar = _with(lidar, lidar.ranges_m[:, :turn], lidar.angle_min_rad)
        notes.append(
            "its first and last beam are the same: one is left out" if more == 1 else f"{more} beams are double"
        )
    beams = lidar.ranges_m.shape[1]
    middle_rad = lidar.angle_min_rad + 0.5 * (beams - 1) * lidar.angle_step_rad
    first_rad = lidar.angle_min_rad - round(middle_rad / math.tau) * math.tau
    last_rad = first_rad + (beams - 1) * lidar.angle_step_rad
    half_rad = 0.5 * lidar.angle_step_rad
    gap_from_rad = math.pi - 0.5 * (turn - beams) * lidar.angle_step_rad  # either way from the fan's middle
    sees_ahead = abs(math.remainder(middle_rad, math.tau)) + math.pi / 2 <= gap_from_rad or beams == turn
    if sees_ahead and (first_rad < -math.pi - half_rad or last_rad > math.pi + half_rad):
        lidar = _rolled(lidar, turn)
        notes.append("its beams do not begin behind the car and are rolled so that ahead is in the middle")
    elif first_rad != lidar.angle_min_rad:
        lidar = replace(lidar, angle_min_rad=first_rad)
    return lidar, [f"{lidar.topic}: {'; '.join(notes)}."] if notes else []


def _rolled(lidar: LidarTrack, turn: int) -> LidarTrack:
    """Roll the beams of a turn, NaN where there are none, so that the first one points just behind the car."""
    missing = turn - lidar.ranges_m.shape[1]
    ranges_m = np.pad(lidar.ranges_m, ((0, 0), (0, missing)), constant_values=np.nan) if missing else lidar.ranges_m
    angles_rad = lidar.angle_min_rad + np.arange(turn) * lidar.angle_step_rad
    wrapped_rad = np.mod(angles_rad + math.pi + 1e-6, math.tau) - math.pi - 1e-6
    first = int(np.argmin(wrapped_rad))
    return _with(lidar, np.roll(ranges_m, -first, axis=1), float(wrapped_rad[first]))


def _with(
    lidar: LidarTrack, ranges_m: npt.NDArray[np.float32], first_rad: float, step_rad: float | None = None
) -> LidarTrack:
    step_rad = lidar.angle_step_rad if step_rad is None else step_rad
    return replace(lidar, ranges_m=ranges_m, angle_min_rad=first_rad, angle_step_rad=step_rad)
