"""A car in virtual time behind a link that delays the lidar's bytes; `python -m benchmarks.late_lidar` has more."""

from pathlib import Path

import numpy as np
import pytest

from tests.system.late_link import Constant, Growing, Jitter, LateDrive, Stepping, deliver_late, drive_late
from wallride.sim.recordings import load_recording

RECORDED = Path(__file__).resolve().parents[2] / ".." / "shared" / "data" / "racecar" / "t14_straight_1mps.npz"


@pytest.mark.parametrize("timeless", [False, True])
def test_a_lidar_that_is_late_from_the_first_byte_never_moves_the_car(timeless):
    found = drive_late(LateDrive("dead_end", 2.0, Constant(0.2), duration_s=4.0, timeless=timeless))
    assert found.way_m < 0.01
    assert any("its scans come 0.19 s late" in text or "its scans come 0.20 s late" in text for text in found.messages)


@pytest.mark.parametrize(
    ("late_s", "timeless"),
    [(Constant(0.3, 2.0), False), (Constant(0.3, 2.0), True), (Growing(0.1, 1.0), False), (Stepping(0.15), False)],
)
def test_a_lidar_that_becomes_late_stops_the_car_before_the_wall_and_for_good(late_s, timeless):
    found = drive_late(LateDrive("dead_end", 3.0, late_s, duration_s=8.0, timeless=timeless))
    assert found.contact_mps is None
    assert 1.0 < found.way_m < 9.0, "the wall is 12 m ahead"
    assert found.stops == 1
    assert found.counts["stale"] > 20


def test_a_lidar_that_comes_within_60_ms_stops_no_drive():
    found = drive_late(LateDrive("straight", 3.0, Jitter(0.06), duration_s=5.0))
    assert (found.stops, found.contact_mps, found.counts) == (0, None, {})
    assert found.way_m > 8.0


@pytest.mark.parametrize(
    ("late_s", "most", "least"),
    [
        (Constant(0.2), 0, 0),
        (Constant(0.09), 200, 150),
        (Constant(0.3, 2.0), 80, 60),
        (Growing(0.1, 1.0), 90, 60),
        (Jitter(0.06), 200, 180),
    ],
)
def test_of_a_real_recording_no_scan_is_delivered_that_is_older_than_it_is_told(late_s, most, least):
    if not RECORDED.exists():
        pytest.skip(f"the recording {RECORDED.name} is not here; it lies in shared/data beside the checkout")
    found = deliver_late(np.asarray(load_recording(RECORDED).ranges_m)[:200], late_s)
    assert least <= found.delivered <= most
    assert found.oldest_s < 0.11
    assert found.younger_s < 0.01
