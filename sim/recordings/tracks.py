"""Output of the readers, in the recorder's absolute time, and assembly of a recording from it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from wallride.sim.recordings.fan import ahead_in_the_middle
from wallride.sim.recordings.recording import (
    CommandTrack,
    Floats,
    LidarTrack,
    OdometryTrack,
    Recording,
    RecordingError,
    plain_name,
)


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
