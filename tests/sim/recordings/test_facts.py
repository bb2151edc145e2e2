"""What the recordings hold, measured once and kept: a later reader may trust these numbers, and notice if one moves."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from wallride.sim.recordings import Recording, RecordingError, load_recording

GAP_S = 0.0375
"""One and a half periods at 40 Hz: at least one scan is missing."""
SELF_M = 0.15
"""A beam that reads less in most scans sees the car itself."""


class Fact(NamedTuple):
    """One recording: gaps are between header stamps."""

    name: str
    scans: int
    duration_s: float
    gaps: int
    longest_gap_s: float
    no_return_percent: float
    self_beams: int
    below_min: int
    worst_delay_s: float


FACTS = [
    Fact("t1_standing_all_topics", 404, 10.08, 0, 0.035, 6.33, 30, 250, 0.033),
    Fact("t1_standing_hall", 605, 15.11, 0, 0.034, 16.51, 13, 213, 0.320),
    Fact("t1_standing_odom_nav", 126, 3.17, 2, 0.080, 7.34, 14, 0, 0.342),
    Fact("t14_straight_1mps", 707, 17.67, 0, 0.027, 16.53, 12, 0, 0.024),
    Fact("t14_straight_2mps", 465, 11.62, 0, 0.026, 18.43, 12, 0, 0.023),
    Fact("t14_start45in_1mps", 751, 18.78, 0, 0.026, 19.53, 12, 0, 0.035),
    Fact("t14_inside_corner_1mps", 605, 15.12, 1, 0.041, 6.70, 8, 0, 0.033),
    Fact("t14_inside_corner_2mps", 300, 7.48, 0, 0.028, 6.52, 7, 0, 0.026),
    Fact("t14_start_out_2mps_gaps", 410, 10.34, 3, 0.101, 12.61, 12, 0, 0.342),
    Fact("t14_outside_corner_gap14s", 724, 32.26, 2, 14.144, 9.29, 12, 0, 0.361),
    Fact("t14_base_gap35s", 740, 65.01, 2, 35.547, 7.99, 12, 0, 0.028),
    Fact("t14_safety_gap3s", 293, 10.76, 1, 3.479, 8.40, 12, 0, 0.029),
    Fact("t3_brake_1_75mps", 410, 10.23, 0, 0.028, 13.38, 26, 0, 0.026),
    Fact("t3_crash_1_5mps", 339, 8.46, 0, 0.026, 13.17, 28, 0, 0.024),
    Fact("t3_wall_data", 770, 19.32, 1, 0.100, 23.96, 0, 0, 0.353),
    Fact("t3_outside_corner", 844, 21.10, 0, 0.029, 14.08, 9, 9, 0.348),
]
WITHOUT_TABLE_ROW = {"t3_foreign_publishers", "t1_odom_safety_no_scan"}


def measured(recording: Recording) -> Fact:
    between_s = np.diff(recording.stamp_s)
    ranges_m = recording.ranges_m
    return Fact(
        name=recording.name,
        scans=len(recording),
        duration_s=round(recording.duration_s, 2),
        gaps=int((between_s > GAP_S).sum()),
        longest_gap_s=round(float(between_s.max()), 3),
        no_return_percent=round(100 * float((ranges_m > recording.range_max_m).mean()), 2),
        self_beams=int(((ranges_m < SELF_M).mean(axis=0) > 0.5).sum()),
        below_min=int((ranges_m < recording.range_min_m).sum()),
        worst_delay_s=round(float((recording.received_s - recording.stamp_s).max()), 3),
    )


@pytest.mark.parametrize("fact", FACTS, ids=lambda fact: fact.name)
def test_a_recording_of_the_racecar(shared_data: Path, fact: Fact) -> None:
    recording = load_recording(shared_data / "racecar" / f"{fact.name}.npz")
    assert measured(recording) == fact
    assert recording.beams == 1081
    assert recording.range_max_m == 30.0
    assert recording.angle_min_rad == pytest.approx(np.radians(-135), abs=1e-6)
    assert recording.angle_step_rad == pytest.approx(np.radians(0.25), abs=1e-6)
    assert 39.9 < 1 / np.median(np.diff(recording.stamp_s)) < 40.25
    assert np.isfinite(recording.ranges_m).all()
    assert (recording.ranges_m[recording.ranges_m > 30.0] == np.float32(65.533)).all(), "no return"


def test_every_recording_has_its_row(shared_data: Path) -> None:
    present = {path.stem for path in (shared_data / "racecar").glob("*.npz")}
    assert present == {fact.name for fact in FACTS} | WITHOUT_TABLE_ROW


def test_stamps_of_foreign_publishers_jump_both_ways(shared_data: Path) -> None:
    recording = load_recording(shared_data / "racecar" / "t3_foreign_publishers.npz")
    clock_s = np.round(recording.received_s - recording.stamp_s)
    clocks = {float(late_s): int((clock_s == late_s).sum()) for late_s in np.unique(clock_s)}
    assert clocks == {0.0: 451, 879.0: 259, 899.0: 141}
    assert (np.diff(recording.stamp_s) < 0).sum() == 370
    assert (np.diff(recording.received_s) >= 0).all()


def test_a_drive_without_lidar_is_refused_by_what_it_lacks(shared_data: Path) -> None:
    path = shared_data / "racecar" / "t1_odom_safety_no_scan.npz"
    with pytest.raises(RecordingError, match=r"no LaserScan \(it holds vesc_low_level_input_safety, vesc_odom\)"):
        load_recording(path)


@pytest.mark.parametrize(
    ("name", "navigation", "output", "safety", "odometry"),
    [
        ("t1_standing_all_topics", 431, 176, 0, 513),
        ("t1_standing_odom_nav", 117, 0, 0, 160),
        ("t1_standing_hall", 0, 0, 0, 0),
        ("t14_straight_1mps", 643, 564, 0, 0),
        ("t14_base_gap35s", 740, 612, 45, 0),
        ("t14_safety_gap3s", 387, 330, 51, 0),
        ("t14_inside_corner_1mps", 579, 467, 1, 0),
        ("t3_brake_1_75mps", 0, 128, 17, 0),
        ("t3_wall_data", 171, 0, 0, 0),
    ],
)
def test_who_spoke(shared_data: Path, name: str, navigation: int, output: int, safety: int, odometry: int) -> None:
    recording = load_recording(shared_data / "racecar" / f"{name}.npz")
    spoke = (recording.navigation, recording.output, recording.safety, recording.odometry)
    assert tuple(0 if track is None else len(track) for track in spoke) == (navigation, output, safety, odometry)


def test_the_deadman_shows_in_the_commands(shared_data: Path) -> None:
    recording = load_recording(shared_data / "racecar" / "t14_straight_1mps.npz")
    asked, passed = recording.navigation, recording.output
    assert asked is not None
    assert passed is not None
    assert set(asked.speed_mps) == {1.0}
    moving_s = passed.received_s[passed.speed_mps == 1.0]
    assert (moving_s[0], moving_s[-1]) == pytest.approx((3.63, 14.48), abs=0.01)
    outside = (passed.received_s < moving_s[0]) | (passed.received_s > moving_s[-1])
    assert set(passed.speed_mps[outside]) == {0.0}
    assert np.abs(asked.steering_rad).max() == pytest.approx(0.34, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "topic", "scans", "beams", "period_s"),
    [
        ("urg04lx_people_512", None, 1265, 512, 0.1),
        ("three_lidars_robot_768", None, 435, 768, 0.133),
        ("three_lidars_robot_768", "rear_scan", 435, 768, 0.133),
        ("three_lidars_robot_768", "/right_scan", 434, 768, 0.133),
        ("urg04lx_front_rear_726", "front_scan", 331, 726, 0.1),
        ("urg04lx_front_rear_726", "rear_scan", 330, 726, 0.1),
    ],
)
def test_other_hokuyos(
    shared_data: Path, name: str, topic: str | None, scans: int, beams: int, period_s: float
) -> None:
    recording = load_recording(shared_data / "hokuyo_other" / f"{name}.npz", topic)
    assert (len(recording), recording.beams) == (scans, beams)
    assert np.median(np.diff(recording.stamp_s)) == pytest.approx(period_s, abs=0.002)
