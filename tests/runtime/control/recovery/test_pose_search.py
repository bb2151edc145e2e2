"""The search over poses: its legs, driven exactly, keep clear of what is on the map and lead off."""

import cmath
import math

import numpy as np
import pytest

from wallride.runtime.control.recovery.floor_map import CELL_M, CELLS, HALF_CELLS
from wallride.runtime.control.recovery.pose_search import MIN_GOAL_M, NO_WAY, TOWARD_RAD, Goal, PoseSearch
from wallride.runtime.control.safety.body import Body
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import CarSettings

CAR = CarSettings()
BODY = Body(SweptSettings(), CAR)
ALONG_M = CELL_M * (np.arange(CELLS) - HALF_CELLS)
X_M, Y_M = np.meshgrid(ALONG_M, ALONG_M)
NOWHERE = np.empty(0, np.complex128)


def search(
    blocked, *, away_m=1.3, earlier_m=NOWHERE, backing=(0.0, 0.4), track=(NOWHERE, NOWHERE), refused=(),
    toward_rad=math.nan,
):  # fmt: skip
    goal = Goal(away_m, earlier_m, toward_rad)
    steps = PoseSearch(
        (BODY.around, BODY.bare), (CAR.max_steering_rad, CAR.wheelbase_m), backing, track, goal, frozenset(refused)
    ).look(blocked)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def driven(way):
    """Every pose on the way, place and heading, in steps of a centimetre or less."""
    place_m, yaw_rad, poses = 0j, 0.0, [(0j, 0.0)]
    for leg in way.legs:
        steps = math.ceil(abs(leg.travel_m) / 0.01)
        for _ in range(steps):
            turn_rad = leg.travel_m / steps * math.tan(leg.steering_rad) / CAR.wheelbase_m
            place_m += leg.travel_m / steps * cmath.rect(1.0, yaw_rad + turn_rad / 2)
            yaw_rad += turn_rad
            poses.append((place_m, yaw_rad))
    return poses


def touches(way, blocked):
    cells_m = (X_M + 1j * Y_M)[blocked]
    return any(
        BODY.bare.holds((cells_m - place_m) * cmath.rect(1.0, -yaw_rad)).any() for place_m, yaw_rad in driven(way)
    )


FREE = np.zeros((CELLS, CELLS), np.bool_)
BEFORE = (X_M > 0.6) & (X_M < 0.9) & (np.abs(Y_M) < 0.4)
LANE = (np.abs(Y_M) > 0.65) | (X_M > 0.6)
"""A lane 1.3 m wide that ends before the car."""
CELL = (np.abs(Y_M) > 0.27) | (X_M > 0.6) | (X_M < -0.6)


def test_on_free_floor_it_goes_straight_on():
    (leg,) = search(FREE).legs
    assert leg.steering_rad == 0.0
    assert leg.travel_m == pytest.approx(1.3, abs=0.13)


def test_round_what_stands_before_the_car_without_a_touch():
    way = search(BEFORE)
    assert way.legs[0].travel_m < 0
    assert not touches(way, BEFORE)
    place_m, yaw_rad = driven(way)[-1]
    assert abs(place_m) >= MIN_GOAL_M
    assert place_m == pytest.approx(way.end_m, abs=0.02)
    assert abs(yaw_rad) < math.radians(100), "round it, not back"


def test_turns_round_where_the_lane_ends_with_no_more_backing_than_allowed():
    way = search(LANE)
    assert not touches(way, LANE)
    assert abs(driven(way)[-1][1]) > math.radians(100)
    backed_m = most_m = 0.0
    for leg in way.legs:
        backed_m = max(0.0, backed_m - leg.travel_m)
        most_m = max(most_m, backed_m)
    assert most_m <= 0.4 + 1e-9


def test_a_cell_without_a_way_has_none():
    assert search(CELL) is NO_WAY


def test_on_its_own_track_it_may_back_farther():
    """A wedge: it is too narrow to turn where the car stands."""
    wedge = (np.abs(Y_M) > 0.28 + 0.45 * np.maximum(0.0, -X_M - 0.3)) | (X_M > 0.6)
    assert search(wedge) is NO_WAY
    track_m = -0.1 * np.arange(20) + 0j
    way = search(wedge, track=(track_m, np.ones_like(track_m)))
    assert way.legs[0].travel_m < -0.4
    assert not touches(way, wedge)


def test_what_led_back_here_is_not_tried_again():
    first = search(BEFORE)
    second = search(BEFORE, earlier_m=np.array([first.end_m]))
    assert abs(second.end_m - first.end_m) >= 0.7


def test_a_refused_move_is_not_the_first_one():
    first = search(BEFORE).legs[0]
    move = (-1, round(first.steering_rad / CAR.max_steering_rad))
    second = search(BEFORE, refused=[move]).legs[0]
    assert (second.steering_rad, second.travel_m > 0) != (first.steering_rad, False)


CORRIDOR = np.abs(Y_M) > 1.0


@pytest.mark.parametrize("blocked", [FREE, CORRIDOR])
@pytest.mark.parametrize("toward_rad", [math.pi, -2.0, 1.2])
def test_it_turns_to_a_bearing(blocked, toward_rad):
    way = search(blocked, toward_rad=toward_rad)
    assert not touches(way, blocked)
    assert way.legs[-1].travel_m > 0
    assert abs(math.remainder(driven(way)[-1][1] - toward_rad, math.tau)) <= TOWARD_RAD + 1e-6


def test_it_does_not_turn_where_there_is_no_room():
    assert search(CELL, toward_rad=math.pi) is NO_WAY
