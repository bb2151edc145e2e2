"""The law `line` in the worlds of the lab: it drives the way of the others there, by its pose, and stops as they do."""

import math

import numpy as np
import pytest

from wallride.sim.lab import covers, hazards, rooms
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.courses.driven_line import ON_M, course_in, line_along
from wallride.sim.lab.courses.sudden import BlindDriver
from wallride.sim.lab.courses.walls import world_of
from wallride.sim.lab.laws import check, needs_line
from wallride.sim.racing.speed_profile import Grip
from wallride.sim.virtual.closed_loop import Case


def cell(experiment, scenario, speed_mps=3.0, side="left", **more):
    return Cell(experiment, scenario, check("line"), speed_mps, 0.8, side, 7, **more)


def test_a_line_along_a_bend_turns_as_it_does_and_goes_on_straight():
    turn_rad = np.linspace(0.0, math.pi / 2, 50)
    line = line_along(
        3.0 * np.sin(turn_rad) + 3j * (1.0 - np.cos(turn_rad)), Grip(0.8, lateral_share=0.6, speed_mps=4.0)
    )
    assert line.length_m > 1.5 * math.pi + ON_M
    assert line.curvature_at(2.0) == pytest.approx(1.0 / 3.0, abs=0.03)
    assert line.curvature_at(10.0) == 0.0
    assert line.place_at(1.5 * math.pi + 5.0) == pytest.approx(3.0 + 8.0j, abs=0.2)
    assert line.speed_at(2.0) < line.speed_at(9.0) == 4.0


def test_the_way_of_a_blind_driver_leads_through_a_wall_that_the_map_has():
    case = Case(world_of("dead_end", "left"), start_speed_mps=2.0, duration_s=8.0, distance_m=14.0)
    course = course_in(case, BlindDriver(2.0), 2.0, blind=True)
    assert course.line.nearest(14.0 + 0.0j).aside_m == pytest.approx(0.0, abs=0.01)
    (wall,) = course.field.lines_at(np.array([11.9 + 0.0j]), np.array([1.0 + 0.0j]))
    assert course.field.normals[wall] == pytest.approx(-1.0, abs=0.01)
    assert -course.field.offsets_m[wall] == pytest.approx(12.0, abs=0.01)


@pytest.mark.parametrize(("scenario", "side"), [("person crosses", "left"), ("bend into a pole", "right")])
def test_a_hazard_stands_on_the_line_and_is_not_touched(scenario, side):
    run = hazards.run(cell("hazards", scenario, side=side))
    assert "race line" in run.reasons
    assert run.contact is None
    assert run.stops or run.distance_m > 11.9


def test_the_line_leads_through_the_way_of_persons_and_round_the_covered_loop():
    run = rooms.run(cell("rooms", "stops in the way at 1 m/s"))
    assert "race line" in run.reasons
    assert run.contact is None
    figures = covers.measure(cell("covers", "silent: 60 deg: driving: loop"))
    assert not figures["collided"]
    assert figures["stands"]


def test_a_map_of_its_own_is_taken_instead():
    assert needs_line(cell("laps", "loop"))
    assert not needs_line(cell("laps", "loop", settings=("map.file=lab.yaml",)))
    assert not needs_line(Cell("laps", "loop", check("ball"), 3.0, 0.8, "left", 7))
