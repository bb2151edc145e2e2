"""The report's law beside what really kept a real car at its wall: same sign, same size, on the straight recordings.

How it is compared: each recorded scan is answered by the law of the runtime; the answer stands beside the first
navigation command recorded after that scan. Only scans during which the recorded mux let the car drive count, and
only where the law follows the wall (its corner rule and theirs differ, and it ends the recordings).
The recorded team's gains and desired distance are unknown, so a constant offset between the two is expected.
"""

from pathlib import Path

import numpy as np
import pytest

from wallride.drivers.api import Scan
from wallride.runtime.control.report.laws import ReportFollower
from wallride.runtime.control.report.settings import ReportFollowSettings
from wallride.sim.figures.comparison import ComparedSteering, compare, drove, recorded_answers
from wallride.sim.recordings import load_recording

RACECAR = Path(__file__).resolve().parents[2] / ".." / "shared" / "data" / "racecar"
MAX_STEERING_RAD = 0.34


def pairs_of(name):
    path = RACECAR / f"{name}.npz"
    if not path.exists():
        pytest.skip(f"the recording {path.name} is not here; it lies in shared/data beside the checkout")
    recording = load_recording(path)
    times_s = list(recording.received_s)
    law = ReportFollower(ReportFollowSettings(side="left", kp=1.5, kd=1.6))
    moved = drove(times_s, recording.output)
    assert recording.navigation is not None
    answers = recorded_answers(times_s, recording.navigation)
    pairs = []
    for ranges_m, time_s, moves, recorded_rad in zip(recording.ranges_m, times_s, moved, answers, strict=True):
        usable = np.where((ranges_m >= 0.02) & (ranges_m <= 30), ranges_m, np.nan)
        scan = Scan(0, 0, recording.angle_min_rad, recording.angle_step_rad, 0.02, 30, usable.astype(np.float32), 0)
        answer = law.follow(scan, None)
        if moves and recorded_rad is not None and answer.drive is not None and answer.reason == "wall":
            ours_rad = float(np.clip(answer.drive.steering_rad, -MAX_STEERING_RAD, MAX_STEERING_RAD))
            pairs.append(ComparedSteering(time_s, ours_rad, recorded_rad))
    return pairs


def test_at_2_mps_where_the_real_car_weaves_ours_weaves_with_it():
    result = compare(pairs_of("t14_straight_2mps"))
    assert result["compared_scans"] > 200
    assert result["clear_turns"] > 150
    assert result["same_sign_share"] > 0.95
    assert result["correlation"] > 0.93
    assert 0.75 < result["slope"] < 1.25
    assert result["median_abs_difference_rad"] < 0.02


def test_at_1_mps_where_the_real_car_hardly_steers_ours_hardly_does():
    result = compare(pairs_of("t14_straight_1mps"))
    assert result["compared_scans"] > 400
    assert result["same_sign_share"] > 0.8
    assert result["median_abs_difference_rad"] < 0.04, "their desired distance differs by a few centimetres"
    assert result["rms_ours_rad"] < 0.08
    assert result["rms_recorded_rad"] < 0.08
