"""What is left and right of the way on: gaps between returns, in the order from the followed wall on."""

import numpy as np
import pytest

from tests.runtime.control.corridor_following.course_scenes import (
    BEND,
    CORRIDOR,
    CROSSROADS,
    DEAD_END,
    JUNCTION,
    course,
    returns_in,
)
from wallride.runtime.control.corridor_following.borders import (
    KEPT_GAP_M,
    REACH_M,
    WIDE_GAP_M,
    borders_at,
    leads_through,
)
from wallride.sim.world.pose import Pose

AHEAD = np.arange(0.0, 4.0, 0.2).astype(np.complex128), np.ones(20, np.complex128)


def test_a_corridor_has_one_gap_where_the_reach_ends():
    returns = returns_in(CORRIDOR)
    assert len(returns.gaps) == 1
    borders = borders_at(returns, returns.gaps[0])
    assert borders.left_m.imag == pytest.approx(np.full(borders.left_m.size, 1.0), abs=0.01)
    assert borders.right_m.imag == pytest.approx(np.full(borders.right_m.size, -1.0), abs=0.01)
    assert 5.0 < borders.left_m.real.max() < REACH_M + 0.5, "as far as neighbours support each other"


def test_a_junction_has_a_gap_on_each_side_and_the_followed_side_comes_first():
    left, right = returns_in(JUNCTION, Pose(4.0, 0.0, 0.0)), returns_in(JUNCTION, Pose(4.0, 0.0, 0.0), "right")
    assert len(left.gaps) == len(right.gaps) == 2
    for returns in (left, right):  # both are seen with the followed wall on the left
        corner_m, beyond_m = returns.places_m[returns.gaps[0]], returns.places_m[returns.gaps[0] + 1]
        assert corner_m == pytest.approx(4.0 + 1j, abs=0.1)
        assert beyond_m.real == pytest.approx(6.0, abs=0.1), "on the wall across"


def test_a_dead_end_has_no_gap():
    assert returns_in(DEAD_END).gaps == ()


def test_a_wall_beside_the_car_is_needed():
    assert returns_in(course([(6, 1), (6, -20)])) is None


def test_a_wall_that_is_seen_along_it_has_no_gap():
    """At 0.25 m from a wall its returns are 1.2 m apart at 8 m, and twice that where one is missing."""
    returns = returns_in(CORRIDOR, Pose(0.0, 0.75, 0.0))
    assert len(returns.gaps) == len(returns.kept) == 1


def test_a_passage_counts_where_no_gap_is_wider_and_for_a_way_that_led_through_it():
    left, passage = [(-5, 0.8), (40, 0.8)], [(40, -0.6), (4, -0.6)]
    alone = returns_in(course(left, [(-5, -1), (4, -1), (4, -0.6)], passage))
    assert len(alone.gaps) == 1
    assert KEPT_GAP_M < abs(np.diff(alone.places_m[alone.gaps[0] : alone.gaps[0] + 2])[0]) < WIDE_GAP_M
    fork = returns_in(course(left, [(-5, -1), (2, -1), (2, -14)], [*passage, (4, -14)]))
    assert len(fork.gaps) == 1
    assert fork.kept[0] < fork.gaps[0] == fork.kept[1]


def test_a_niche_is_no_way():
    niche = course([(-5, 1), (3, 1), (3, 1.4), (4.2, 1.4), (4.2, 1), (60, 1)], [(-5, -1), (60, -1)])
    returns = returns_in(niche)
    assert len(returns.gaps) == 1
    assert returns.places_m[returns.gaps[0]].real > 5.0


def test_sight_ends_behind_a_corner():
    returns = returns_in(BEND)
    spare_m = returns.sees(np.array([4.0 + 0j, 6.0 + 0.5j, 6.0 + 3.0j]))
    assert (spare_m > 0).tolist() == [True, True, False]


def test_a_way_leads_through_the_gap_that_it_has_on_both_sides():
    returns = returns_in(CROSSROADS, Pose(3.0, 0.0, 0.0))
    through = [leads_through(returns, gap, *AHEAD) for gap in returns.gaps]
    assert len(through) >= 3
    assert through[0] is False, "that leads to the left"
    assert sum(through) == 1
