"""Recordings that hold or lack what a ROS tool of another year wrote: what can be read is, and the rest is named."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.rosbag2 import StoragePlugin

from tests.sim.recordings.conftest import Said, Stage
from wallride.sim.recordings import RecordingError, load_recording


def as_mcap(path: Path, stage: Stage, said: list[Said], *, foreign: str = "") -> Path:
    """Write messages of ROS 1 as its converters do. foreign: a topic in an encoding that is not ROS's."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros1")
        channels: dict[str, int] = {}
        for topic, kind, received_s, message in said:
            if topic not in channels:
                schema = writer.register_schema(kind.replace("/msg/", "/"), "ros1msg", b"")
                channels[topic] = writer.register_channel(topic, "protobuf" if topic == foreign else "ros1", schema)
            at_ns = round(received_s * 1e9)
            writer.add_message(channels[topic], at_ns, bytes(stage.store.serialize_ros1(message, kind)), at_ns)
        writer.finish()
    return path


def test_messages_of_ros1_in_an_mcap_are_read(ros1: Any, ros1_story: Any, tmp_path: Path) -> None:
    recording = load_recording(as_mcap(tmp_path / "r.mcap", ros1, ros1_story))
    assert len(recording) == 5
    assert recording.ranges_m[2, 0] == 3.0
    assert recording.navigation is not None
    assert recording.odometry is not None
    assert recording.odometry.yaw_rad[0] == pytest.approx(0.5)
    assert recording.notes == ()


def test_messages_in_another_encoding_are_counted_and_the_rest_is_read(
    ros1: Any, ros1_story: Any, tmp_path: Path
) -> None:
    recording = load_recording(as_mcap(tmp_path / "r.mcap", ros1, ros1_story, foreign="/vesc/odom"))
    assert len(recording) == 5
    assert recording.odometry is None
    assert recording.notes == ("5 messages on /vesc/odom could not be decoded (protobuf) and are left out.",)
    with pytest.raises(RecordingError, match=r"5 messages on /scan could not be decoded \(protobuf\)"):
        load_recording(as_mcap(tmp_path / "s.mcap", ros1, ros1_story, foreign="/scan"))


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_split_folder_without_metadata_is_read_in_the_order_of_its_names(
    ros2: Any, tmp_path: Path, plugin: StoragePlugin
) -> None:
    folder = tmp_path / "split"
    folder.mkdir()
    for number in (2, 10):
        said = [ros2.scan(100.0 + number + 0.025 * k, [float(number)] * 5) for k in range(3)]
        (piece,) = (
            path for path in ros2.write(tmp_path / f"{number}", said, plugin).iterdir() if path.suffix != ".yaml"
        )
        piece.rename(folder / f"split_{number}{piece.suffix}")
    recording = load_recording(folder)
    np.testing.assert_array_equal(recording.ranges_m[:, 0], [2, 2, 2, 10, 10, 10])
    assert recording.notes == ("split lacks its metadata.yaml: its files are read in the order of their names.",)


def test_a_split_folder_that_lacks_a_file_is_read_and_the_sentence_names_it(ros2: Any, tmp_path: Path) -> None:
    folder = ros2.write(tmp_path / "r", [ros2.scan(100.0 + 0.025 * k, [1.0] * 5) for k in range(3)])
    metadata = folder / "metadata.yaml"
    text = metadata.read_text()
    metadata.write_text(text.replace("  - r.db3\n", "  - r.db3\n  - r_1.db3\n"))
    assert metadata.read_text() != text
    recording = load_recording(folder)
    assert len(recording) == 3
    assert "r_1.db3" in recording.notes[0]


def test_a_damaged_file_of_a_folder_costs_only_its_own_scans(ros2: Any, tmp_path: Path) -> None:
    folder = tmp_path / "split"
    folder.mkdir()
    for number in (0, 1):
        said = [ros2.scan(100.0 + number + 0.025 * k, [float(number)] * 1081) for k in range(100)]
        (piece,) = ros2.write(tmp_path / f"{number}", said, StoragePlugin.MCAP).glob("*.mcap")
        piece.rename(folder / f"split_{number}.mcap")
    content = (folder / "split_0.mcap").read_bytes()
    (folder / "split_0.mcap").write_bytes(content[:100])
    recording = load_recording(folder)
    assert set(recording.ranges_m[:, 0]) == {1.0}
    assert len(recording) == 100
    assert any("split_0.mcap" in note for note in recording.notes)
