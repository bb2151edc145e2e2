"""Every format gives the same recording; every file that is none is refused with one sentence."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from wallride.runtime.wire import topics
from wallride.sim.recordings import Recording, RecordingError, load_recording

ORIGINALS = [
    ("t1_standing_all_topics", ""),
    ("t1_standing_odom_nav", ""),
    ("t14_inside_corner_2mps", ""),
    ("t14_inside_corner_2mps", "sinside_corner_1_speed_2_0.db3"),
]


def assert_equal(one: Recording, other: Recording) -> None:
    """Exactly, bit by bit; NaN equals NaN."""
    for name in ("received_s", "stamp_s", "ranges_m"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    for name in ("topic", "other_topics", "angle_min_rad", "angle_step_rad", "range_min_m", "range_max_m",
                 "scan_time_s"):  # fmt: skip
        assert getattr(one, name) == getattr(other, name), name
    assert one.commands.keys() == other.commands.keys()
    for topic, track in one.commands.items():
        for column in ("received_s", "speed_mps", "steering_rad"):
            np.testing.assert_array_equal(getattr(track, column), getattr(other.commands[topic], column), err_msg=topic)
    assert (one.odometry is None) == (other.odometry is None)
    if one.odometry is not None and other.odometry is not None:
        for column in ("received_s", "x_m", "y_m", "yaw_rad", "vx_mps", "vy_mps", "wz_radps"):
            theirs = getattr(other.odometry, column)
            np.testing.assert_allclose(getattr(one.odometry, column), theirs, rtol=0, atol=1e-12, err_msg=column)


@pytest.mark.parametrize(("name", "inside"), ORIGINALS)
def test_an_original_equals_its_archive(shared_data: Path, name: str, inside: str) -> None:
    original = load_recording(shared_data / "originals" / name / inside)
    assert_equal(original, load_recording(shared_data / "racecar" / f"{name}.npz"))


@pytest.mark.parametrize("topic", ["/front_scan", "rear_scan", None])
def test_a_ros1_original_equals_its_archive_for_each_of_its_lidars(shared_data: Path, topic: str | None) -> None:
    name = "urg04lx_front_rear_726"
    original = load_recording(shared_data / "originals" / f"{name}.bag", topic)
    assert_equal(original, load_recording(shared_data / "hokuyo_other" / f"{name}.npz", topic))


def test_the_carried_bag_is_the_start_of_its_original(carried_bag: Path, shared_data: Path) -> None:
    carried = load_recording(carried_bag)
    original = load_recording(shared_data / "hokuyo_other" / "urg04lx_people_512.npz")
    np.testing.assert_array_equal(carried.ranges_m, original.ranges_m[:40])
    np.testing.assert_array_equal(carried.received_s, original.received_s[:40])


def test_a_real_bag_is_read_untouched(carried_bag: Path) -> None:
    recording = load_recording(carried_bag)
    assert (len(recording), recording.beams, recording.topic, recording.notes) == (40, 512, "/scan", ())
    assert recording.received_s[0] == 0.0
    assert recording.duration_s == pytest.approx(3.887, abs=0.001)
    assert recording.ranges_m.dtype == np.float32
    assert np.isposinf(recording.ranges_m[39, 250])
    assert np.isnan(recording.ranges_m[39, 251])
    assert recording.ranges_m[39, 253] == np.float32(5.403)
    assert recording.angle_min_rad == pytest.approx(-np.pi / 2, abs=1e-6)
    with pytest.raises(ValueError, match="read-only"):
        recording.ranges_m[0, 0] = 1.0


def as_archive(stage: Any, path: Path, said: Any) -> Path:
    scans = [(s, m) for _, kind, s, m in said if kind.endswith("LaserScan")]
    nav = [(s, m.drive.speed, m.drive.steering_angle) for topic, _, s, m in said if topic.endswith("nav_0")]
    out = [(s, m.drive.speed, m.drive.steering_angle) for topic, _, s, m in said if topic.endswith("ackermann_cmd")]
    odom = [
        (s, m.pose.pose.position.x, -1.0, 0.5, m.twist.twist.linear.x, 0.0, 0.5)
        for topic, _, s, m in said
        if "odom" in topic
    ]
    np.savez(
        path,
        topic="/scan",
        recv=np.array([s for s, _ in scans]),
        stamps=np.array([m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for _, m in scans]),
        ranges=np.stack([m.ranges for _, m in scans]),
        angle_min=-1.0,
        angle_increment=0.5,
        range_min=float(np.float32(0.02)),
        range_max=30.0,
        scan_time=float(np.float32(0.025)),
        vesc_high_level_input_nav_0__recv=np.array(nav)[:, 0],
        vesc_high_level_input_nav_0__speed_steering=np.array(nav)[:, 1:],
        vesc_low_level_ackermann_cmd__recv=np.array(out)[:, 0],
        vesc_low_level_ackermann_cmd__speed_steering=np.array(out)[:, 1:],
        vesc_odom__recv=np.array(odom)[:, 0],
        vesc_odom__x_y_yaw_vx_vy_wz=np.array(odom)[:, 1:],
    )
    return path


def inner(folder: Path, suffix: str) -> Path:
    (found,) = folder.glob(f"*.{suffix}")
    return found


FORMATS: dict[str, Callable[[Any, Path, Any], Path]] = {
    "db3 folder": lambda stage, folder, said: stage.write(folder / "r", said),
    "db3 alone": lambda stage, folder, said: inner(stage.write(folder / "r", said), "db3"),
    "mcap folder": lambda stage, folder, said: stage.write(folder / "r", said, StoragePlugin.MCAP),
    "mcap alone": lambda stage, folder, said: inner(stage.write(folder / "r", said, StoragePlugin.MCAP), "mcap"),
    "npz": lambda stage, folder, said: as_archive(stage, folder / "r.npz", said),
}


@pytest.mark.parametrize("form", FORMATS)
def test_every_ros2_format_gives_the_same(ros2: Any, ros2_story: Any, tmp_path: Path, form: str) -> None:
    assert_is_the_story(load_recording(FORMATS[form](ros2, tmp_path, ros2_story)))


def test_a_ros1_bag_gives_the_same(ros1: Any, ros1_story: Any, tmp_path: Path) -> None:
    assert_is_the_story(load_recording(ros1.write(tmp_path / "r.bag", ros1_story)))


def assert_is_the_story(recording: Recording) -> None:
    assert (recording.name, recording.topic, recording.other_topics, recording.notes) == ("r", "/scan", (), ())
    np.testing.assert_allclose(recording.received_s, [0.0, 0.025, 0.05, 0.075, 0.1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(recording.stamp_s, recording.received_s - 0.02, rtol=0, atol=2e-9)
    row = np.array([3.0, 65.533, 0.004, np.inf, np.nan], dtype=np.float32)
    np.testing.assert_array_equal(recording.ranges_m[2], row)
    assert recording.range_max_m == 30.0
    assert recording.scan_time_s == pytest.approx(0.025)
    assert list(recording.commands) == ["vesc_high_level_input_nav_0", "vesc_low_level_ackermann_cmd"]
    navigation, output, odometry = recording.navigation, recording.output, recording.odometry
    assert navigation is not None
    assert output is not None
    assert odometry is not None
    assert recording.safety is None
    np.testing.assert_allclose(navigation.received_s, [-0.01], rtol=0, atol=1e-9)
    assert (navigation.speed_mps[0], navigation.steering_rad[0]) == (1.0, 0.25)
    assert len(output) == 5
    assert output.steering_rad[0] == -0.25
    np.testing.assert_allclose(odometry.received_s[0], 0.002, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(odometry.x_m, [0.0, 1.0, 2.0, 3.0, 4.0])
    np.testing.assert_allclose(odometry.yaw_rad, 0.5, rtol=0, atol=1e-9)
    assert (odometry.y_m[0], odometry.vx_mps[0], odometry.wz_radps[0]) == (-1.0, 1.5, 0.5)


def test_of_several_lidars_the_one_named_scan_is_played_and_the_others_are_named(ros2: Any, tmp_path: Path) -> None:
    said = [ros2.scan(1.0 + k, [1.0], topic) for k in range(3) for topic in ("/back_scan", "/left_scan")]
    recording = load_recording(ros2.write(tmp_path / "r", [*said, ros2.scan(9.0, [2.0])]))
    assert (recording.topic, recording.other_topics, len(recording)) == ("/scan", ("/back_scan", "/left_scan"), 1)
    assert recording.notes == ("r holds 3 lidars: /scan is played, not /back_scan, /left_scan.",)


@pytest.mark.parametrize("topic", ["left_scan", "/left_scan"])
def test_a_lidar_is_chosen_by_its_name(ros2: Any, tmp_path: Path, topic: str) -> None:
    said = [ros2.scan(1.0, [1.0]), ros2.scan(3.0, [3.0], "/left_scan")]
    recording = load_recording(ros2.write(tmp_path / "r", said), topic)
    assert (recording.topic, recording.ranges_m[0, 0], recording.received_s[0]) == ("/left_scan", 3.0, 0.0)
    assert recording.notes == ()
    with pytest.raises(RecordingError, match="holds no lidar topic /top: choose one of /left_scan, /scan"):
        load_recording(tmp_path / "r", "/top")


def test_scans_with_other_beams_are_left_out_and_counted(ros2: Any, tmp_path: Path) -> None:
    said = [ros2.scan(1.0, [9.0]), ros2.scan(2.0, [1.0, 2.0]), ros2.scan(3.0, [3.0, 4.0])]
    recording = load_recording(ros2.write(tmp_path / "r", said))
    np.testing.assert_array_equal(recording.ranges_m, [[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(recording.received_s, [0.0, 1.0])
    assert recording.notes == ("1 scans on /scan have other beams than the other 2 and are left out.",)


def test_scans_are_put_in_the_order_of_their_reception(tmp_path: Path) -> None:
    ranges_m, received_s = np.array([[1.0], [2.0], [3.0]]), np.array([12.0, 11.0, 13.0])
    recording = load_recording(archive(tmp_path / "r.npz", recv=received_s, stamps=received_s - 0.5, ranges=ranges_m))
    np.testing.assert_array_equal(recording.ranges_m, [[2.0], [1.0], [3.0]])
    np.testing.assert_array_equal(recording.received_s, [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(recording.stamp_s, [-0.5, 0.5, 1.5])


def archive(path: Path, **changes: Any) -> Path:
    """Write an archive of three scans. changes: other arrays, None for one that is left out."""
    arrays: dict[str, Any] = {
        "ranges": np.ones((3, 5)), "stamps": np.arange(3.0), "recv": np.arange(3.0), "angle_min": -1.0,
        "angle_increment": 0.5, "range_min": 0.02, "range_max": 30.0, "scan_time": 0.025, "topic": "/scan",
    }  # fmt: skip
    np.savez(path, **{name: value for name, value in (arrays | changes).items() if value is not None})
    return path


def test_an_archive_without_a_topic_is_read(tmp_path: Path) -> None:
    assert len(load_recording(archive(tmp_path / "a.npz", topic=None))) == 3


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"stamps": None}, "lacks the array 'stamps'; beside ranges a recording needs stamps, recv"),
        ({"recv": np.arange(2.0)}, "recv has 2 entries for 3 messages"),
    ],
)
def test_an_archive_of_other_arrays_is_refused(tmp_path: Path, changes: dict[str, Any], says: str) -> None:
    with pytest.raises(RecordingError, match=says):
        load_recording(archive(tmp_path / "a.npz", **changes))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"gone\.npz does not exist"):
        load_recording(tmp_path / "gone.npz")


def test_a_folder_without_a_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"folder without metadata\.yaml, \.db3 and \.mcap: give \.npz"):
        load_recording(tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("notes.txt", b"hello", "no recording that can be read"),
        ("empty.npz", b"", "no readable archive"),
        ("text.npz", b"hello, I am text", "no readable archive"),
        ("cut.npz", b"PK\x03\x04" + bytes(40), "damaged"),
        ("text.bag", b"hello", "does not begin with #ROSBAG"),
        ("old.bag", b"#ROSRECORD V1.2\n", r"old bag format \(#ROSRECORD V1\.2\).* rosbag fix"),
        ("start.bag", b"#ROSBAG V2.0\n", "no scan could be saved"),
        ("empty.db3", b"", "no scan could be saved"),
        ("text.db3", b"hello, I am text" * 99, "no scan could be saved"),
        ("empty.mcap", b"", "no scan could be saved"),
        ("text.mcap", b"hello", "no scan could be saved"),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, name: str, content: bytes, says: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=says) as refusal:
        load_recording(path)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_folder_with_broken_metadata_is_refused(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 99}")
    with pytest.raises(RecordingError, match="version 99 not supported"):
        load_recording(tmp_path)


def test_a_recording_without_lidar_says_what_it_holds(ros2: Any, tmp_path: Path) -> None:
    path = ros2.write(tmp_path / "r", [ros2.odometry(1.0, 0.0, 0.0, 0.0), ros2.command(1.0, 1.0, 0.0, "/drive")])
    with pytest.raises(RecordingError, match=r"holds no LaserScan \(it holds drive, vesc_odom\)"):
        load_recording(path)


def test_archives_are_read_without_rosbags(ros2: Any, ros2_story: Any, tmp_path: Path, monkeypatch: Any) -> None:
    archive = as_archive(ros2, tmp_path / "r.npz", ros2_story)
    folder = ros2.write(tmp_path / "r", ros2_story)
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    assert len(load_recording(archive)) == 5
    with pytest.raises(RecordingError, match=r"needs the package rosbags.*install wallride with its extra \[sim\]"):
        load_recording(folder)


def test_rosbags_is_imported_only_when_needed() -> None:
    check = "import sys, wallride.sim.recordings; sys.exit('rosbags' in sys.modules)"
    subprocess.run([sys.executable, "-c", check], cwd=Path(__file__).resolve().parents[3], check=True)


def test_a_recording_of_wallride_is_timed_by_its_first_beams_and_has_every_command(dead_end: Path) -> None:
    recording = load_recording(dead_end)
    assert recording.sweep_s == pytest.approx(0.01875, abs=1e-5)
    np.testing.assert_allclose(recording.received_s - recording.stamp_s, recording.sweep_s, rtol=0, atol=1e-6)
    assert recording.output is recording.commands[topics.OUTPUT]
    assert len(recording.output) == len(recording)
