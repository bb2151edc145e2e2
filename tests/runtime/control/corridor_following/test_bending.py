"""The way that bends least: within its bounds, with its first points where they were."""

from itertools import pairwise

import numpy as np
import pytest

from wallride.runtime.control.corridor_following.bending import KEEP_M, bounds_of, straightened
from wallride.runtime.control.corridor_following.borders import CourseBorders
from wallride.runtime.control.corridor_following.kept_way import even
from wallride.runtime.control.corridor_following.marching import STEP_M, course_of, curvature_of

FIXED = 5


def along_m(length_m):
    return np.arange(0.0, length_m, STEP_M).astype(np.complex128)


def border(*corners):
    """Return places every 8 cm along a chain of corners."""
    return np.concatenate([a + (b - a) * np.linspace(0, 1, 1 + int(abs(b - a) / 0.08)) for a, b in pairwise(corners)])


STRAIGHT = CourseBorders(border(-2 + 1j, 12 + 1j), border(-2 - 1j, 12 - 1j))
ROUND_A_CORNER = CourseBorders(border(-2 + 1j, 4 + 1j, 4 + 9j), border(-2 - 1j, 6 - 1j, 6 + 9j))


def settled(way_m, borders, rounds=6):
    for _ in range(rounds):
        course = course_of(way_m)
        way_m = even(straightened(way_m, course, FIXED, bounds_of(way_m, course, borders)), FIXED)
    return way_m


def middle_round_the_corner():
    arc = 4 + 1j + 1.0 * np.exp(1j * np.arange(-np.pi / 2, 0.0, STEP_M))
    return np.concatenate([along_m(4.0), arc, 5 + 1j * np.arange(1.1, 6.0, STEP_M)])


def away_m(way_m, borders):
    return np.abs(np.concatenate(borders) - way_m[:, None]).min(axis=1)


def test_bounds_are_the_room_on_both_sides():
    way_m = along_m(6.0) + 0.2j
    bounds = bounds_of(way_m, course_of(way_m), STRAIGHT)
    assert bounds.most_m == pytest.approx(np.full(30, 0.8 - KEEP_M), abs=0.01)
    assert bounds.least_m == pytest.approx(np.full(30, -0.5), abs=0.01), "as far as a way is moved at once"
    assert not bounds.lack_m.any()


def test_where_the_course_is_narrow_the_middle_is_kept():
    way_m = along_m(6.0) + 0.05j
    narrow = CourseBorders(border(-2 + 0.4j, 12 + 0.4j), border(-2 - 0.4j, 12 - 0.4j))
    bounds = bounds_of(way_m, course_of(way_m), narrow)
    assert bounds.most_m == pytest.approx(np.full(30, -0.05), abs=0.01)
    assert (bounds.least_m == bounds.most_m).all()
    assert bounds.lack_m == pytest.approx(np.full(30, 2 * KEEP_M - 0.8), abs=0.01)


def test_the_first_points_stay_where_they_are():
    way_m = middle_round_the_corner()
    assert (settled(way_m, ROUND_A_CORNER)[:FIXED] == way_m[:FIXED]).all()


def test_a_corner_is_cut_and_both_borders_are_kept_off():
    way_m = middle_round_the_corner()
    settled_m = settled(way_m, ROUND_A_CORNER)
    assert np.abs(curvature_of(settled_m)).max() < 0.8 * np.abs(curvature_of(way_m)).max()
    assert away_m(settled_m, ROUND_A_CORNER).min() > KEEP_M - 0.03


def test_the_bend_changes_gently():
    bends = curvature_of(settled(middle_round_the_corner(), ROUND_A_CORNER))
    assert np.abs(np.diff(bends)).max() < 0.35, "1.7 /m in a metre: what the servo gives within 0.1 s at 2 m/s"


def test_noise_of_the_borders_moves_a_straight_way_little():
    noise = np.random.default_rng(3)
    way_m = along_m(8.0)
    noisy = CourseBorders(*(side + 0.02j * noise.normal(size=side.size) for side in STRAIGHT))
    assert np.abs(settled(way_m, noisy).imag).max() < 0.01


def test_even_points_are_on_the_curve():
    turn = np.exp(1j * np.cumsum(np.tile([0.1, 0.14], 20)))
    points = even((2.0 * turn).astype(np.complex128), 5)
    assert np.abs(points) == pytest.approx(np.full(points.size, 2.0), abs=3e-3)
    assert np.abs(np.diff(points[5:])) == pytest.approx(np.full(points.size - 6, STEP_M), rel=0.02)
