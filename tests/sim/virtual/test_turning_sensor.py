"""Lidars of a full circle drive the simulated car through their own bytes, in virtual time."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.sim.devices import lidar_kinds
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.courses.sudden import case_of
from wallride.sim.lab.hazards import case_of_hazard
from wallride.sim.lab.laws import build
from wallride.sim.virtual.closed_loop import Case, SimulatedRun, drive
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.obstacles import Box, Obstacle, StandingObstacle
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry
from wallride.sim.world.worlds import load_world
from wallride.sim_options import LIDARS

SLOW = "a1", "s3", "x2"
"""A legacy stream, a dense one, a YDLIDAR; `benchmarks/lidars.py` drives all."""


def drive_with(word: str, world: str, speed_mps: float, **conditions: Any) -> SimulatedRun:
    follower, guard = build("ball", "left", 1.0, speed_mps)
    conditions = {"duration_s": 14.0, "lidar": LidarSettings(noise_std_m=0.01, outlier_share=0.005), **conditions}
    return drive(Case(load_world(world, side="left"), turning=word, **conditions), follower, guard)


def mean_error_m(run: SimulatedRun) -> float:
    return float(np.abs(run.error_m[np.isfinite(run.error_m)]).mean())


def test_every_word_of_the_command_line_is_a_lidar():
    for word in LIDARS:
        assert (lidar_kinds.emulated(word) is None) == (word == "hokuyo")


def test_a_model_that_the_settings_name_is_the_one_that_is_emulated():
    named = {"x2": "x2", "x4": "x4", "g4": "g4", "g6": "g6", "auto": "ydlidar"}
    for model, word in named.items():
        assert lidar_kinds.word_of(YdlidarSettings.model_validate({"model": model})) == word


@pytest.fixture(scope="module")
def usual():
    return drive_with("", "loop", 1.0)


@pytest.mark.parametrize("word", SLOW)
def test_each_follows_the_walls_of_the_loop(word, usual):
    run = drive_with(word, "loop", 1.0)
    assert run.contact is None
    assert run.distance_m > 0.9 * usual.distance_m
    assert mean_error_m(run) < 2.0 * mean_error_m(usual)
    assert not [stop for stop in run.stops if stop.from_s > 1.0]


@pytest.mark.parametrize(("word", "speed_mps"), [("x2", 1.2)])
def test_at_the_speed_that_it_allows_it_follows_the_walls_nearly_as_well(word, speed_mps):
    run, usual = (drive_with(one, "loop", speed_mps, duration_s=20.0, seed=4500011) for one in (word, ""))
    assert mean_error_m(run) < 1.5 * mean_error_m(usual)


@pytest.mark.parametrize("word", ["x4"])
def test_a_box_in_the_way_is_a_stop(word):
    box = Obstacle(Box(0.3, 0.6), StandingObstacle(Pose(7.0, 0.0, 0.0)))
    run = drive_with(word, "corridor", 1.5, obstacles=(box,), duration_s=9.0)
    assert run.contact is None
    assert run.speed_mps[-1, 0] < 0.1


@pytest.mark.parametrize("word", ["a2"])
def test_missing_returns_are_driven_with(word):
    run = drive_with(word, "corridor", 1.0, lidar=LidarSettings(noise_std_m=0.01, dropout_share=0.3), duration_s=10.0)
    assert run.contact is None
    assert run.distance_m > 8.0


@pytest.mark.parametrize(
    ("word", "missing_share", "drives", "duration_s"), [("x4", 0.3, True, 18.0), ("c1", 1.0, False, 6.0)]
)
def test_in_a_hall_a_third_may_be_missing_and_a_covered_one_stops(word, missing_share, drives, duration_s):
    corners = np.array([[-10.0, -7.0], [10.0, -7.0], [10.0, 7.0], [-10.0, 7.0]])
    hall = World("", SegmentGeometry(np.hstack([corners, np.roll(corners, -1, axis=0)])), Pose(-8.0, 6.0, 0.0))
    follower, guard = build("ball", "left", 1.0, 1.0)
    lidar = LidarSettings(noise_std_m=0.01, outlier_share=0.005, dropout_share=missing_share)
    run = drive(Case(hall, side="left", turning=word, lidar=lidar, duration_s=duration_s, seed=3), follower, guard)
    assert run.contact is None
    if drives:
        assert run.distance_m > 15.0
        assert not run.stops
    else:
        assert run.distance_m == 0.0
        assert "lidar sees almost nothing" in run.reasons[-1]


@pytest.mark.parametrize(("word", "most_mps"), [("a2", 2.0), ("x4", 1.4)])
def test_the_speed_is_what_the_lidar_allows(word, most_mps):
    run = drive_with(word, "corridor", 4.0, duration_s=7.0)
    assert run.contact is None
    assert run.speed_mps[:, 0].max() < 1.07 * most_mps
    assert run.speed_mps[:, 0].max() > 0.85 * most_mps
    assert any(reason.startswith("no faster with this lidar") for reason in run.reasons)


@pytest.mark.parametrize(
    ("word", "scenario", "speed_mps", "side"),
    [("x2", "follower corridor 0.3-left 0.6m", 1.2, "left"), ("g6", "follower wall full-width 1.2m", 2.0, "right")],
)
def test_a_sudden_box_is_braked_for_between_two_scans_and_not_a_scan_too_late(word, scenario, speed_mps, side):
    """Touched at 0.6 m/s where the scan did not grow older, and where a turn was ended between two scans."""
    cell = Cell("safety", scenario, "ball", speed_mps, 0.8, side, 4500101)
    run = drive(replace(case_of(cell), turning=word), *build("ball", side, 1.0, speed_mps))
    assert run.contact is None


@pytest.mark.parametrize("scenario", ["person crosses", "person stops in the way"])
def test_who_walks_across_is_seen_although_cells_without_a_sample_cut_him_in_two(scenario):
    case, navigator = case_of_hazard(Cell("hazards", scenario, "ball", 2.0, 0.8, "left", 4500101))
    follower, guard = build("ball", "left", 1.0, 2.0)
    assert drive(replace(case, turning="a3"), navigator or follower, guard).contact is None
