"""Laps of the simulated car: the map is the truth's, and a broken recording is refused or corrected."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.racing.maps import MAX_M, RMS_M, MapDrive, errors_m, recorded
from wallride.sim.mapping.closing import close_lap
from wallride.sim.mapping.verdict import CONTRADICTION, contradiction, judge_map


@cache
def mapped(flaw="", *, gyro=True):
    record, truth = recorded(MapDrive("loop", 4.0, 0.8, 3, gyro=gyro, flaw=flaw), Path())
    lap = close_lap(record)
    return judge_map(record, lap), errors_m(lap, record, truth), lap


@pytest.mark.parametrize("gyro", [True, False])
def test_the_path_of_a_lap_is_the_true_one_whatever_wheels_and_steering_say(gyro):
    verdict, off_m, lap = mapped(gyro=gyro)
    assert verdict.reasons == ()
    assert np.sqrt(np.mean(off_m**2)) < RMS_M
    assert off_m.max() < MAX_M
    assert lap.car.scale == pytest.approx(1 / 1.03, abs=0.003)
    if gyro:
        assert lap.car.gyro_scale == pytest.approx(1 / 1.01, abs=0.005)
    if not gyro:
        assert lap.car.trim_rad == pytest.approx(0.02, abs=0.003)


def test_wheels_that_are_ten_percent_wrong_are_corrected():
    verdict, off_m, lap = mapped("wheels")
    assert verdict.good
    assert off_m.max() < MAX_M
    assert lap.car.scale == pytest.approx(1 / 1.1, abs=0.004)


@pytest.mark.parametrize(
    ("flaw", "reason"),
    [
        ("open", "the ring is open: the drive ends"),
        ("silent", "scans are missing for 10.0 s at 4.5 s while the car moved"),
    ],
)
def test_a_broken_recording_is_refused_with_the_reason(flaw, reason):
    verdict, _, _ = mapped(flaw)
    assert not verdict.good
    assert reason in "; ".join(verdict.reasons)


@pytest.mark.parametrize(("bend_rad", "good"), [(0.01, True), (0.1, False)])
def test_a_map_that_is_bent_by_more_than_a_map_may_be_wrong_contradicts_its_end(bend_rad, good):
    _, _, lap = mapped(gyro=True)
    turn_rad = np.linspace(0.0, bend_rad, len(lap.poses))
    places = lap.poses[:, :2] @ np.array([1.0, 1j])
    places[1:] = places[0] + np.cumsum(np.diff(places) * np.exp(1j * turn_rad[1:]))
    bent = np.column_stack([places.real, places.imag, lap.poses[:, 2] + turn_rad])
    assert (contradiction(bent, lap.loops) < CONTRADICTION) is good


def test_wheels_that_are_ten_percent_wrong_are_corrected_without_a_gyro_on_a_winding_track():
    """One pass finds half of it; the lap's ends then lie 2.9 m apart, beyond the search for a loop."""
    record, truth = recorded(MapDrive("track:seed=302", 2.0, 0.8, 2205, gyro=False, flaw="wheels"), Path())
    lap = close_lap(record)
    assert judge_map(record, lap).good
    assert errors_m(lap, record, truth).max() < MAX_M
