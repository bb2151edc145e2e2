"""`benchmarks.lab corners`: the places in buildings, the lanes, the options, and what the follower reaches there."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.lab import corners
from benchmarks.lab.__main__ import parsed
from benchmarks.lab.building_places import CORNER_RAD, OFF_M, STARTS, building, is_held_out, places_on
from wallride.sim.lab.cell import Cell, CellChoice
from wallride.sim.lab.command import chosen, run
from wallride.sim.world.pose import Pose, Side

SKIRK = Path(__file__).resolve().parents[2] / ".." / "shared" / "data" / "maps" / "skirk.yaml"
needs_maps = pytest.mark.skipif(not SKIRK.is_file(), reason="the maps lie in shared/data beside the checkout")


def cell(experiment, scenario, law="ball", speed_mps=3.0, mu=0.5, side="left", seed=1, desired_m=1.0):
    return Cell(experiment, scenario, law, speed_mps, mu, side, seed, desired_m)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("way", ["in", "out"])
def test_a_lane_behind_a_sharp_corner_is_seen_before_it_on_a_slippery_floor(way, seed):
    run = corners.run(cell("benchmarks.lab.corners", f"{way} 110 deg, 1.5 m", seed=seed))
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


@pytest.fixture
def hall(tmp_path):
    """A map, alone in its folder."""
    Image.new("L", (40, 40), 254).save(tmp_path / "hall.png")
    (file := tmp_path / "hall.yaml").write_text(
        "image: hall.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    return file


def test_every_run_is_of_the_named_car_and_on_the_maps_of_the_folder(hall):
    asked = ["--condition", "vehicle.trim_rad=0.03", "--speeds", "2", "--quick", "--maps", str(hall.parent)]
    choice = chosen(parsed(["corners", *asked]))
    assert choice.maps == (str(hall),)
    cells = corners.cells(choice)
    assert {one.conditions for one in cells} == {("vehicle.trim_rad=0.03",)}
    assert corners.run(cells[0]).case.vehicle.trim_rad == 0.03


def test_the_command_writes_the_figures_and_a_picture_of_every_run(tmp_path, hall, capsys):
    file, plots = tmp_path / "figures.json", tmp_path / "pictures"
    asked = ["--only", "in 60 deg? 2 m", "--speeds", "3", "--mu", ".8", "--side", "left", "--jobs", "1"]
    asked += ["--maps", str(hall.parent)]
    assert run(parsed(["corners", *asked, "--json", str(file), "--plot", str(plots)])) == 0
    (one,) = json.loads(file.read_text())["cells"]
    assert one["scenario"] == "in 60 deg, 2 m"
    assert len([*plots.iterdir()]) == 1
    assert "0 of 1 runs with a contact" in capsys.readouterr().out
