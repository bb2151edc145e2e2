"""Entry point: opens a recording by its path, whatever its format."""

from pathlib import Path

from wallride.sim.recordings.archive import read_archive
from wallride.sim.recordings.recording import Recording, RecordingError
from wallride.sim.recordings.ros import read_ros
from wallride.sim.recordings.tracks import Tracks, assemble

ROS1_MAGIC = b"#ROSBAG V2.0\n"
FORMATS = ".npz, .bag (ROS 1), .db3, .mcap, or the folder of a ROS 2 recording"


def load_recording(path: Path, topic: str | None = None) -> Recording:
    """Return a recording for playback.

    path: .npz, .bag, .db3, .mcap, or a folder of .db3 or .mcap files.
    topic: which lidar, when the file holds several; with or without slashes. See `Recording.other_topics`.

    Of a damaged ROS recording the undamaged scans are returned, and `Recording.notes` states their number.

    Raises:
        RecordingError: the file is missing, is no recording, is damaged beyond use, or holds no such lidar.
    """
    name = path.resolve().name if path.is_dir() else path.stem
    try:
        return assemble(name, _tracks(path), topic)
    except OSError as error:
        raise RecordingError(f"{path} cannot be opened: {error.strerror or error}.") from error


def _tracks(path: Path) -> Tracks:
    if not path.exists():
        raise RecordingError(
            f"{path} does not exist: give a name that `wallride logs` lists, or the path of {FORMATS}."
        )
    if path.is_dir():
        if not any([*path.glob(one)] for one in ("metadata.yaml", "*.db3", "*.mcap")):
            raise RecordingError(f"{path} is a folder without metadata.yaml, .db3 and .mcap: give {FORMATS}.")
        return read_ros(path)
    if path.suffix == ".npz":
        return read_archive(path)
    if path.suffix == ".bag":
        _require_ros1_bag(path)
        return read_ros(path)
    if path.suffix in {".db3", ".mcap"}:
        return read_ros(path)
    raise RecordingError(f"{path} is no recording that can be read: give {FORMATS}.")


def _require_ros1_bag(path: Path) -> None:
    with path.open("rb") as bag:
        start = bag.readline(32)
    if start == ROS1_MAGIC:
        return
    if start.startswith(b"#ROS"):
        version = start.decode(errors="replace").strip()
        raise RecordingError(
            f"{path} is in an old bag format ({version}), not V2.0: convert it with ROS 1's rosbag fix."
        )
    raise RecordingError(f"{path} is no ROS 1 bag, whatever its name says: it does not begin with #ROSBAG.")
