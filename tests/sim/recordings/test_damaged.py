"""Damaged files: every whole scan is saved, no broken one is, and the user is told how many there were."""

import re
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin

from wallride.sim.recordings import RecordingError, load_recording
from wallride.sim.recordings.salvage import whole_messages


def test_every_scan_of_a_bag_whose_line_ends_were_converted_is_saved(shared_data: Path) -> None:
    recording = load_recording(shared_data / "damaged" / "crlf_stripped_v2.bag")
    assert (len(recording), recording.beams) == (360, 681)
    assert recording.range_max_m == pytest.approx(5.6)
    assert "360 scans were saved" in recording.notes[0]
    assert np.all(np.abs(np.diff(recording.stamp_s) - 0.1) < 0.01), "10 Hz without a hole"
    assert recording.ranges_m.max() < 5.6


def test_salvage_finds_in_a_healthy_bag_what_its_index_finds(carried_bag: Path) -> None:
    messages = list(whole_messages(carried_bag.read_bytes()))
    assert len(messages) == 40
    assert {(topic, kind) for topic, kind, _, _ in messages} == {("/scan", "sensor_msgs/msg/LaserScan")}
    received_s = np.array([ns for _, _, ns, _ in messages]) * 1e-9
    np.testing.assert_array_equal(received_s - received_s[0], load_recording(carried_bag).received_s)


@pytest.mark.parametrize("lost_at", [13, 5000, 40_000, 60_000, 90_000, 94_000])
def test_a_lost_byte_costs_one_scan_at_most(carried_bag: Path, tmp_path: Path, lost_at: int) -> None:
    content = carried_bag.read_bytes()
    damaged = tmp_path / "damaged.bag"
    damaged.write_bytes(content[:lost_at] + content[lost_at + 1 :])
    saved, whole = load_recording(damaged), load_recording(carried_bag)
    assert len(whole) - 1 <= len(saved) <= len(whole)
    assert f"{len(saved)} scans were saved" in saved.notes[0]
    originals = {row.tobytes() for row in whole.ranges_m}
    assert all(row.tobytes() in originals for row in saved.ranges_m), "a broken scan passed for a whole one"


@given(start=st.integers(14, 95_000), lost=st.integers(1, 2000))
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
def test_no_broken_message_passes_for_a_whole_one(carried_bag: Path, start: int, lost: int) -> None:
    content = carried_bag.read_bytes()
    originals = set(whole_messages(content))
    saved = list(whole_messages(content[:start] + content[start + lost :]))
    assert originals.issuperset(saved)
    assert len(saved) >= 38, "2000 bytes touch two scans at most"


@pytest.mark.parametrize("kept_bytes", [20_000, 50_000, 80_000])
def test_a_bag_cut_off_while_recording_keeps_its_start(carried_bag: Path, tmp_path: Path, kept_bytes: int) -> None:
    cut = tmp_path / "cut.bag"
    cut.write_bytes(carried_bag.read_bytes()[:kept_bytes])
    saved, whole = load_recording(cut), load_recording(carried_bag)
    assert abs(len(saved) - kept_bytes / 95405 * 40) < 3
    np.testing.assert_array_equal(saved.ranges_m, whole.ranges_m[: len(saved)])
    assert saved.notes[0].startswith("cut.bag cannot be read in order (")
    assert not re.search(r"\('|,\)", saved.notes[0]), "a sentence"


def many_scans(stage: Any, count: int) -> list[Any]:
    return [stage.scan(1.0 + 0.025 * k, [float(k)] * 1081) for k in range(count)]


def test_an_mcap_of_a_killed_recorder_keeps_its_whole_chunks(ros2: Any, tmp_path: Path) -> None:
    folder = ros2.write(tmp_path / "r", many_scans(ros2, 600), StoragePlugin.MCAP)
    (path,) = folder.glob("*.mcap")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 3 // 4])
    recording = load_recording(path)
    assert 200 < len(recording) < 600
    np.testing.assert_array_equal(recording.ranges_m[:, 7], np.arange(len(recording)))
    assert f"{len(recording)} scans were saved" in recording.notes[0]
    assert sorted(folder.iterdir()) == sorted([path, folder / "metadata.yaml"]), "nothing is left beside the file"


def test_a_db3_with_an_overwritten_page_keeps_what_comes_before_it(ros2: Any, tmp_path: Path) -> None:
    (path,) = ros2.write(tmp_path / "r", many_scans(ros2, 200)).glob("*.db3")
    content = path.read_bytes()
    middle = len(content) // 2 // 4096 * 4096
    path.write_bytes(content[:middle] + bytes([255]) * 4096 + content[middle + 4096 :])
    recording = load_recording(path)
    assert 50 < len(recording) < 200
    np.testing.assert_array_equal(recording.ranges_m[:, 7], np.arange(len(recording)))
    assert f"{len(recording)} scans were saved" in recording.notes[0]


@pytest.mark.parametrize("kept_share", [0.25, 0.5, 0.9])
def test_a_cut_db3_keeps_what_comes_before_the_cut(ros2: Any, tmp_path: Path, kept_share: float) -> None:
    (path,) = ros2.write(tmp_path / "r", many_scans(ros2, 200)).glob("*.db3")
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * kept_share)])
    recording = load_recording(path)
    assert len(load_recording(path.parent)) == len(recording), "the same through the folder"
    assert len(recording) == pytest.approx(200 * kept_share, abs=6)
    np.testing.assert_array_equal(recording.ranges_m[:, 7], np.arange(len(recording)))
    assert f"{len(recording)} scans were saved" in recording.notes[0]


def test_a_database_that_leads_a_parser_astray_is_told_without_pythons_words(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "x.db3")) as database:
        database.execute("CREATE TABLE topics(id, name, type, serialization_format, offered_qos_profiles)")
        database.execute("CREATE TABLE messages(id, topic_id, timestamp, data)")
        database.execute("INSERT INTO topics VALUES(1, '/scan', 'sensor_msgs/msg/LaserScan', 'cdr', '')")
        database.execute("INSERT INTO messages VALUES(1, 1, 1, NULL)")
        database.commit()
    with pytest.raises(RecordingError, match=r"x\.db3 cannot be read \(its records contradict each other\)"):
        load_recording(tmp_path / "x.db3")
