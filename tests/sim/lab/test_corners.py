"""`wallride lab corners`: the prototype, the places in buildings, the lanes, and what the follower reaches there."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.runtime.control.wall_following.ball_scenes import scan_in
from wallride.runtime.control.perception.view import PerceptionCache
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.lab import corners, laws, walls
from wallride.sim.lab.cell import Cell, CellChoice
from wallride.sim.lab.courses.building_places import CORNER_RAD, OFF_M, STARTS, building, is_held_out, places_on
from wallride.sim.lab.courses.prototype import KD, KP_RAD_PER_M, Prototype, target_rad
from wallride.sim.world.pose import Pose, Side

SKIRK = Path(__file__).resolve().parents[3] / ".." / "shared" / "data" / "maps" / "skirk.yaml"
needs_maps = pytest.mark.skipif(not SKIRK.is_file(), reason="the maps lie in shared/data beside the checkout")


def cell(experiment, scenario, law="ball", speed_mps=3.0, mu=0.5, side="left", seed=1, desired_m=1.0):
    return Cell(experiment, scenario, law, speed_mps, mu, side, seed, desired_m)


def mean_error_m(run):
    return float(np.abs(run.error_m[np.isfinite(run.error_m)]).mean())


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_prototype_steers_by_its_two_gains(side):
    """0.1 m too far from a straight wall the ball is at asin(0.1 / 0.4) on a circle of 0.4 m."""
    law = Prototype(side, 1.0, 1.0, CarSettings(), PerceptionCache(CarSettings()))
    answer = law.follow(scan_in("straight", y_m=-0.1, side=side), None)
    assert answer.drive is not None
    sign = 1.0 if side == "left" else -1.0
    wanted_rad = min(KP_RAD_PER_M * 0.1 + KD * math.asin(0.1 / 0.4), 0.34)
    assert answer.drive.steering_rad == pytest.approx(sign * wanted_rad, abs=0.02)
    assert answer.error_m == pytest.approx(0.1, abs=0.005)


def test_the_prototypes_target_is_the_first_place_from_the_free_side_that_is_too_near():
    wall_m = np.stack([np.arange(-2.0, 3.0, 0.05), np.full(100, 1.2)])
    bearing_rad, found = target_rad(wall_m, 0.7, 1.0)
    assert found
    assert bearing_rad == pytest.approx(math.asin(0.2 / 0.7), abs=0.01)
    bearing_rad, found = target_rad(wall_m, 0.1, 1.0)
    assert not found
    assert bearing_rad == pytest.approx(math.radians(85))


def test_the_prototype_is_what_the_design_notes_measured():
    """Inside corner .05 m at 1 m/s, doorway .005: their table for this law, in this simulator."""
    assert mean_error_m(walls.run(cell("walls", "t5", "prototype", 1.0, 0.8))) == pytest.approx(0.052, abs=0.01)
    assert mean_error_m(walls.run(cell("walls", "doorway", "prototype", 1.0, 0.8))) < 0.008


def test_only_the_lab_has_the_prototype():
    assert laws.check("prototype") == "prototype+swept"
    with pytest.raises(ValueError, match="no law"):
        laws.check("prototypes")


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_outside_corner_is_followed_and_not_swung_out_for(side):
    run = walls.run(cell("walls", "outside_corner", speed_mps=1.0, mu=0.8, side=side))
    before = run.pose[:, 0] < 5.9
    assert run.contact is None
    assert mean_error_m(run) <= 0.006
    assert np.abs(run.error_m[before]).max() < 0.01
    away_rad = -run.wish[before, 1] if side == "left" else run.wish[before, 1]
    # 0.34 when a bend farther away was fed forward; a single scan is noise.
    assert np.convolve(away_rad, np.ones(4) / 4, "valid").max() < 0.1


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("way", ["in", "out"])
def test_a_lane_behind_a_sharp_corner_is_seen_before_it_on_a_slippery_floor(way, seed):
    run = corners.run(cell("corners", f"{way} 110 deg, 1.5 m", seed=seed))
    assert run.contact is None
    assert run.distance_m >= corners.LANE_WAY_M
    assert not [stop.reason for stop in run.stops if "brak" in stop.reason]


def test_a_lane_has_the_widths_and_the_angle_that_it_says():
    sides: tuple[tuple[Side, float], ...] = (("left", 1.0), ("right", -1.0))
    for side, sign in sides:
        world = corners.lane("out 60 deg, 1.5 m", side)
        assert world.wall_distance_m(Pose(0.0, 0.0, 0.0), side) == pytest.approx(1.0)
        after = Pose(6.0, sign * 1.0, -sign * math.radians(60)).ahead(6.0, -sign * 0.5)
        across_m = world.cast(
            after.x_m, after.y_m, np.array([after.yaw_rad - math.pi / 2, after.yaw_rad + math.pi / 2])
        )
        assert sorted(across_m) == pytest.approx([0.5, 1.0])


@needs_maps
@pytest.mark.parametrize("side", ["left", "right"])
def test_places_are_beside_their_wall_and_half_of_them_are_held_out(side):
    found = places_on(str(SKIRK), side, 1.0)
    assert {place.start for place in found} == set(STARTS)
    assert sum(is_held_out("skirk", place.number) for place in found) == len(found) // 2
    world = building(str(SKIRK), side)
    for place in found:
        share, toward_rad = STARTS[place.start]
        along = Pose(
            place.pose.x_m, place.pose.y_m, place.pose.yaw_rad - (toward_rad if side == "left" else -toward_rad)
        )
        assert world.wall_distance_m(along) == pytest.approx(share, abs=OFF_M)
        assert world.clearance(place.pose) > 0.1
    assert places_on(str(SKIRK), side, 1.0) == found
    assert CORNER_RAD > 0.5
    assert places_on(str(SKIRK), side, 9.0) == ()


@needs_maps
def test_two_laws_are_compared_on_the_same_courses_and_a_contact_is_never_better():
    choice = CellChoice(("ball+swept", "prototype+swept"), (2.0,), (0.8,), ("left",), (7,), maps=(str(SKIRK),))
    two = [one for one in corners.cells(choice) if one.scenario.endswith((" 3", " 4"))]
    assert len(two) == 4
    rows = [one.named(corners.measure(one)) for one in two]
    pairs = corners.compared(rows)
    assert [row["law"] for pair in pairs for row in pair] == ["ball+swept", "prototype+swept"] * 2
    mine, other = pairs[0]
    assert corners.not_worse({**mine, "mean_error_m": 0.1}, {**other, "mean_error_m": 0.1})
    assert not corners.not_worse({**mine, "mean_error_m": 0.11}, {**other, "mean_error_m": 0.1})
    assert not corners.not_worse({**mine, "collided": True}, other)
    assert corners.ratio({**mine, "mean_error_m": 0.1}, {**other, "mean_error_m": 0.2}) == 0.5
    assert "held out" in {line[0] for line in corners.tables(rows)[-1].rows}
