"""A car that stands against the way on: it is turned to it, where there is room."""

import math

import numpy as np
import pytest

from tests.runtime.control.recovery.stage import Stage
from wallride.runtime.control.recovery.traffic import Traffic
from wallride.runtime.control.recovery.way_out import NO_ADVICE, TURNS
from wallride.sim.world.segments import SegmentGeometry, box

LANE = SegmentGeometry(np.array([*box(0.0, 0.0, 20.0, 2.2, 0.0)]))
HALL = SegmentGeometry(np.array([*box(0.0, 0.0, 20.0, 8.0, 0.0)]))
NARROW = SegmentGeometry(np.array([*box(0.0, 0.0, 20.0, 1.0, 0.0)]))


def toward(stage, yaw_rad):
    """Return the bearing of a direction in the world; NaN where the car goes that way already."""
    off_rad = math.remainder(yaw_rad - stage.pose.yaw_rad, math.tau)
    return off_rad if abs(off_rad) > 1.0 else math.nan


@pytest.mark.parametrize("yaw_rad", [math.pi, -2.5, 1.6])
def test_a_car_that_goes_the_wrong_way_is_turned_without_a_touch(yaw_rad):
    stage = Stage(LANE)
    stage.go(1.0)
    for _ in range(1200):
        stage.step(toward_rad=toward(stage, yaw_rad))
        assert stage.clearance_m > 0.0
        if stage.advice == NO_ADVICE:
            break
    assert abs(math.remainder(yaw_rad - stage.pose.yaw_rad, math.tau)) < 0.8
    assert stage.said[0] == TURNS


def test_where_there_is_no_room_to_turn_it_goes_on_and_looks_again_after_some_metres():
    stage = Stage(NARROW)
    stage.go(1.0)
    for _ in range(340):
        stage.step(toward_rad=toward(stage, math.pi))
    assert stage.pose.x_m > 2.0
    assert stage.said == [TURNS]


def test_a_car_that_may_not_back_out_does_not_turn():
    stage = Stage(LANE, tries=0)
    assert {stage.step(toward_rad=math.pi) for _ in range(40)} == {NO_ADVICE}


@pytest.mark.parametrize(("walls", "turns"), [(HALL, True), (LANE, False)])
def test_while_something_may_be_behind_it_turns_forward_alone_or_waits(monkeypatch, walls, turns):
    monkeypatch.setattr(Traffic, "is_about", True)
    stage = Stage(walls)
    stage.go(1.0)
    slowest_mps = 0.0
    for _ in range(600):
        stage.step(toward_rad=toward(stage, math.pi))
        slowest_mps = min(slowest_mps, stage.speed_mps)
    assert slowest_mps == 0.0
    assert (abs(math.remainder(math.pi - stage.pose.yaw_rad, math.tau)) < 1.0) == turns
    assert stage.said[0] == TURNS
