"""Back to the sensor's integers: exact for what a sensor can have sent, rejectable for what is no number."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.sim.recordings import NO_RETURN_MM, load_recording, to_sensor_mm

NAN, INF = np.nan, np.inf


@pytest.mark.parametrize(
    ("range_m", "limits_m", "sensor_mm"),
    [
        (65.533, (0.02, 30.0), 65533),
        (0.0, (0.02, 30.0), 0),
        (0.004, (0.02, 30.0), 4),
        (1.2344, (0.02, 30.0), 1234),
        (1.2346, (0.02, 30.0), 1235),
        (-0.5, (0.02, 30.0), 0),
        (500.0, (0.02, 30.0), 262143),
        (INF, (0.02, 5.6), 65533),
        (NAN, (0.02, 5.6), 65533),
        (-INF, (0.02, 5.6), 0),
        (-INF, (0.0, 5.6), 65533),
        (INF, (0.02, 80.0), 262143),
        (NAN, (0.02, 80.0), 262143),
    ],
)
def test_table(range_m: float, limits_m: tuple[float, float], sensor_mm: int) -> None:
    assert to_sensor_mm(np.array([range_m], dtype=np.float32), *limits_m).tolist() == [sensor_mm]


@given(st.lists(st.integers(0, 262143), min_size=1, max_size=50))
def test_every_integer_that_scip_carries_survives_the_way_through_float32_metres(sent_mm: list[int]) -> None:
    recorded_m = (np.array(sent_mm) / 1000).astype(np.float32)
    assert to_sensor_mm(recorded_m, 0.02, 30.0).tolist() == sent_mm


def test_a_real_recording_becomes_whole_millimetres(shared_data: Path) -> None:
    recording = load_recording(shared_data / "racecar" / "t14_straight_1mps.npz")
    sent_mm = to_sensor_mm(recording.ranges_m, recording.range_min_m, recording.range_max_m)
    assert sent_mm.shape == recording.ranges_m.shape
    np.testing.assert_array_equal((sent_mm / 1000).astype(np.float32), recording.ranges_m)
    assert (sent_mm == NO_RETURN_MM).mean() == pytest.approx(0.165, abs=0.001)
