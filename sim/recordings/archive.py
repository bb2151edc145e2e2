"""Reader of the .npz archives: each message type of a bag copied into plain arrays, field by field.

The main lidar's arrays have plain names (`ranges`, `stamps`, `recv`, ...), those of further topics begin with
`<topic>__`; commands are `<topic>__speed_steering`, odometry is `<topic>__x_y_yaw_vx_vy_wz`.
"""

import math
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.runtime.recording.unpacking import bomb, most_bytes
from wallride.sim.recordings.recording import CommandTrack, LidarTrack, OdometryTrack, RecordingError, plain_name
from wallride.sim.recordings.tracks import Tracks, columns

NEEDED = ("stamps", "recv", "angle_min", "angle_increment", "range_min", "range_max", "scan_time")
DEFAULT_TOPIC = "scan"
Arrays = Mapping[str, npt.NDArray[Any]]


def read_archive(path: Path) -> Tracks:
    """Return all tracks of an .npz archive.

    Raises:
        RecordingError: the file is damaged, is no archive of arrays, or its arrays do not fit each other.
    """
    try:
        # opened here, because numpy leaves the file open when it finds damage
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            _check_sizes(archive.zip, path.stat().st_size)
            arrays = {name: archive[name] for name in archive.files}
    except (zipfile.BadZipFile, zlib.error) as error:
        raise RecordingError(f"{path} is damaged ({error}) and nothing can be saved: fetch it again.") from error
    except Exception as error:  # numpy and zipfile raise more than a dozen kinds for a damaged header
        raise RecordingError(
            f"{path} is no readable archive of arrays ({error}): fetch or convert it again."
        ) from error
    try:
        return _tracks(arrays)
    except KeyError as error:
        raise RecordingError(
            f"{path} lacks the array {error}; beside ranges a recording needs {', '.join(NEEDED)}: convert it again."
        ) from error
    except (ValueError, TypeError, IndexError) as error:
        raise RecordingError(f"{path} holds arrays that are not those of a recording: {error}.") from error


def _check_sizes(archive: zipfile.ZipFile, size_bytes: int) -> None:
    """Refuse arrays that claim more than their file holds, and more than its size explains."""
    if sum(member.file_size for member in archive.infolist()) > most_bytes(size_bytes):
        raise bomb(size_bytes)
    for member in archive.infolist():
        with archive.open(member) as file:
            version = np.lib.format.read_magic(file)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, kind = read(file)
        if math.prod(shape) * kind.itemsize > member.file_size:
            raise ValueError(f"{member.filename} claims {math.prod(shape) * kind.itemsize} bytes and has fewer")


def _tracks(arrays: Arrays) -> Tracks:
    tracks = Tracks()
    for name, values in arrays.items():
        topic, _, kind = name.rpartition("__")
        prefix = f"{topic}__" if topic else ""
        if len(values.shape) == 0 or len(values) == 0:
            continue
        if kind == "ranges":
            lidar = _lidar(arrays, prefix)
            tracks.lidars[plain_name(lidar.topic)] = lidar
        elif kind == "speed_steering":
            tracks.commands[topic] = CommandTrack(_times(arrays, prefix, values), *columns(values, 2))
        elif kind == "x_y_yaw_vx_vy_wz":
            tracks.odometries[topic] = OdometryTrack(_times(arrays, prefix, values), *columns(values, 6))
    return tracks


def _lidar(arrays: Arrays, prefix: str) -> LidarTrack:
    ranges_m = arrays[f"{prefix}ranges"].astype(np.float32, copy=False)
    if ranges_m.ndim != 2:
        raise ValueError(f"{prefix}ranges has shape {ranges_m.shape}, not (scans, beams)")
    stamp_s = arrays[f"{prefix}stamps"].astype(np.float64, copy=False)
    if len(stamp_s) != len(ranges_m):
        raise ValueError(f"{prefix}stamps has {len(stamp_s)} entries for {len(ranges_m)} scans")
    return LidarTrack(
        topic=str(arrays.get(f"{prefix}topic", prefix.removesuffix("__") or DEFAULT_TOPIC)),
        received_s=_times(arrays, prefix, ranges_m),
        stamp_s=stamp_s,
        ranges_m=ranges_m,
        angle_min_rad=float(arrays[f"{prefix}angle_min"]),
        angle_step_rad=float(arrays[f"{prefix}angle_increment"]),
        range_min_m=float(arrays[f"{prefix}range_min"]),
        range_max_m=float(arrays[f"{prefix}range_max"]),
        scan_time_s=float(arrays[f"{prefix}scan_time"]),
    )


def _times(arrays: Arrays, prefix: str, values: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    received_s = arrays[f"{prefix}recv"].astype(np.float64, copy=False)
    if len(received_s) != len(values):
        raise ValueError(f"{prefix}recv has {len(received_s)} entries for {len(values)} messages")
    return received_s
