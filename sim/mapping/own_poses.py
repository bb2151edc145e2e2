"""The poses that a car found itself while it drove, against the same scans laid over the map again."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.control.localization.localizer import PoseEstimate
from wallride.runtime.line_files import LINE_SUFFIX, course_of, read_line
from wallride.runtime.map_files import CarMap, MapError
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.recording.decision_log import FollowerEvent, ScanEvent
from wallride.runtime.wire import topics
from wallride.sim.replay.drive_log import DriveLog, decode
from wallride.sim.replay.reenact import events_of
from wallride.sim.replay.settings_text import settings_of

SAME_SCAN_S: Final = 1e-3


@dataclass(frozen=True, slots=True)
class OwnPoses:
    """How many poses the car has recorded, how many of them are found again to the bit, and all that are found."""

    recorded: int
    same: int
    found: tuple[PoseEstimate, ...]


def own_poses(log: DriveLog, known: CarMap, line: CourseLine | None = None) -> OwnPoses | None:
    """Return the comparison; None where the car found no pose, or on another map. line: the one that it had."""
    settings = settings_of(log, laws=False)
    recorded = list(log.of(topics.POSE))
    if not recorded or Path(settings.map.file).stem != known.name:
        return None
    found, ahead_s = _found_again(log, known, line)
    stamps_s = np.array([one.stamp_s for one in found])
    same = 0
    for message in recorded:
        place = int(np.argmin(np.abs(stamps_s - (message.stamp_ns / NS - ahead_s)))) if found else 0
        near = found and abs(stamps_s[place] - (message.stamp_ns / NS - ahead_s)) < SAME_SCAN_S
        same += bool(near) and _is_same(decode(message).pose, found[place])
    return OwnPoses(len(recorded), same, tuple(found))


def line_of(log: DriveLog, map_file: Path) -> CourseLine | None:
    """Return the line that a car had with its map, as far as it is still there."""
    named = settings_of(log, laws=False).map.line
    path = Path(named).expanduser() if named else map_file.with_name(map_file.stem + LINE_SUFFIX)
    try:
        return read_line(path) if path.is_file() else None
    except MapError:
        return None


def _found_again(log: DriveLog, known: CarMap, line: CourseLine | None) -> tuple[list[PoseEstimate], float]:
    """Return the estimates by the very scans and reports that the car had, and how far its stamps are behind 1970."""
    settings = settings_of(log, laws=False)
    localizer = course_of(known, settings.map.start, settings.car, line).localizer
    messages = {message.sequence: message for message in log.of(topics.SCAN)}
    scans: dict[int, ScanEvent] = {}
    found: list[PoseEstimate] = []
    ahead_s = 0.0
    for event in events_of(log):
        if isinstance(event, ScanEvent) and event.sequence in messages:
            scans[event.sequence] = event
            ahead_s = messages[event.sequence].stamp_ns / NS - event.stamp_s
        elif isinstance(event, FollowerEvent) and (taken := scans.pop(event.sequence, None)) is not None:
            ranges_m = np.array(decode(messages[event.sequence]).ranges, np.float32)
            found.append(localizer.localize(taken.scan(ranges_m), event.motor))
    return found, ahead_s


def _is_same(told: Any, found: PoseEstimate) -> bool:  # noqa: ANN401 - a message as it was decoded
    place, turn, covariance = told.pose.position, told.pose.orientation, told.covariance
    return bool(
        (place.x, place.y) == (found.x_m, found.y_m)
        and (turn.z, turn.w) == (math.sin(found.yaw_rad / 2), math.cos(found.yaw_rad / 2))
        and (covariance[0], covariance[35]) == (found.std_m**2, found.std_rad**2)
    )
