"""What `line` promises is what it then drives, and a promise that was missed widens the next ones."""

import cmath
import math

import numpy as np
import pytest

from tests.runtime.control.line_following.lines import circle
from tests.runtime.control.line_following.test_line_law import TYRES, WIDE, beside, driven
from wallride.runtime.control.line_following import line_law, promising
from wallride.runtime.control.line_following.promising import Promises, Return, way_ahead

STEP_S = 0.025


def course_rad(car):
    return car.yaw_rad - TYRES.rear_slip_rad(car.speed_mps * car.turn_radps)


def test_points_speeds_and_directions_ahead_go_round_the_seam():
    line = circle(radius_m=3.0)
    ways_m = np.arange(0.0, 25.0, 0.5)
    places, directions, speeds = line.ahead(line.length_m - 1.0, ways_m)
    assert np.abs(places) == pytest.approx(np.full(50, 3.0), abs=0.001)
    assert places == pytest.approx([line.place_at(line.length_m - 1.0 + way_m) for way_m in ways_m])
    assert directions == pytest.approx(1j * places / np.abs(places), abs=0.01)
    assert set(speeds) == {2.0}


@pytest.mark.parametrize("speed", [1.5, 3.0, 5.0])
@pytest.mark.parametrize(("aside_m", "off_rad"), [(0.0, 0.0), (0.2, 0.0), (-0.15, 0.1)])
def test_the_promised_way_is_driven(speed, aside_m, off_rad):
    car = beside(aside_m=aside_m, off_rad=off_rad, speed=speed)
    on = WIDE.nearest(car.place_m)
    back = Return.of(on, course_rad(car), line_law.feedback_per_m(speed, TYRES))
    places, speeds = way_ahead(WIDE, back, (car.place_m, car.yaw_rad), speed)
    assert places[0] == 0j
    assert set(speeds) == {4.0}
    assert abs(places[-1]) > speed**2 / 6.0
    promised = car.place_m + places * cmath.exp(1j * car.yaw_rad)
    for now in driven(car, WIDE, TYRES.steering_rad(1 / 6.0, speed)):
        chords = np.diff(promised)
        share = np.clip(((now.place_m - promised[:-1]) * chords.conj()).real / np.abs(chords) ** 2, 0.0, 1.0)
        assert np.abs(promised[:-1] + share * chords - now.place_m).min() < 0.1


def test_a_promise_bends_no_more_than_the_grip_allows():
    speed_mps, steps_m, bends_radpm = 5.5, np.arange(0.0, 6.0, 0.05), []
    car = beside(aside_m=0.1, off_rad=0.2, speed=speed_mps)
    on, most_radpm = WIDE.nearest(car.place_m), TYRES.most_radpm(speed_mps)
    for bound_radpm in (most_radpm, math.inf):
        per_m = line_law.feedback_per_m(speed_mps, TYRES)
        aside_m = Return.of(on, course_rad(car), per_m, bound_radpm).aside_at(steps_m)
        bends_radpm.append(np.abs(on.curvature_radpm + np.diff(aside_m, 2) / 0.05**2).max())
    assert bends_radpm[0] <= most_radpm < 0.8 * bends_radpm[1]


def checked(made, scans, aside_m=0.0):
    """Let the car be so far beside its line at these scans."""
    for k in scans:
        made.check(Return((0.1 * k) % 40.0, aside_m, 0.0, 1.0), 40.0, STEP_S)
    return made.margin_m


def test_a_promise_that_was_missed_widens_the_next_ones_for_a_while():
    made = Promises()
    assert checked(made, range(120)) < promising.FIRST_MARGIN_M
    assert checked(made, range(120, 140), 0.25) == pytest.approx(0.25, abs=0.02)
    assert checked(made, range(140, 2000)) < 0.06


def test_a_new_beginning_is_no_missed_promise():
    made = Promises()
    checked(made, range(30))
    made.begin()
    assert -math.inf < checked(made, [200], 0.4) < promising.FIRST_MARGIN_M


def test_what_was_broken_by_a_stop_is_not_held_against_the_slower_laps_after_it():
    made = Promises()
    checked(made, range(20))
    assert checked(made, range(20, 40), 0.3) > 0.25
    made.held_back()
    assert made.margin_m == promising.FIRST_MARGIN_M
    assert checked(made, range(40, 56)) < promising.FIRST_MARGIN_M, "no promise from before it counts"
