"""Beams end at the same place however they are cast: compiled or in numpy."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wallride.drivers.accelerated import Accelerated, UnfitError
from wallride.sim.world import compiled
from wallride.sim.world.grid import GridGeometry, cast_cells
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry, box, cast_walls, chain

FAN_RAD = np.radians(np.linspace(-135.0, 135.0, 1081))
AGREE_M = 1e-9
SAME_SPOT = 0.998
"""Share of beams that must agree; the others pass a corner so closely that rounding decides."""

needs_compiler = pytest.mark.skipif(compiled.by_c(cast_walls) is None, reason="there is no C compiler here")
seeds = st.integers(0, 10_000)


def cluttered_walls(rng):
    """Two dozen walls of all sizes and directions in a closed room, and some poles."""
    ends = rng.uniform(-5, 5, (24, 2))
    angle, length = rng.uniform(-4, 4, 24), rng.uniform(0.01, 3.0, 24)
    loose = np.column_stack([ends, ends[:, 0] + length * np.cos(angle), ends[:, 1] + length * np.sin(angle)])
    room = chain([(-7, -6), (7, -6), (7, 6), (-7, 6)], closed=True)
    return np.vstack([loose, room, box(1.0, 1.0, 0.5, 0.3, 0.4)]), rng.uniform([-5, -5, 0.01], [5, 5, 0.4], (4, 3))


def cluttered_grid(rng):
    """A turned grid of 60 x 80 cells with a tenth of them solid."""
    solid = rng.random((60, 80)) < 0.1
    solid[30, 40] = False
    return solid, 0.05, Pose(rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(-3, 3))


def a_free_place(grid, rng):
    row, column = np.argwhere(~grid.solid)[rng.integers((~grid.solid).sum())]
    x, y = grid.cell_centre(int(row), int(column))
    return x + rng.uniform(-0.01, 0.01), y + rng.uniform(-0.01, 0.01)


def assert_agree(ranges_m, expected_m):
    far = np.isinf(expected_m)
    difference = np.where(far | np.isinf(ranges_m), 0.0, ranges_m) - np.where(far | np.isinf(ranges_m), 0.0, expected_m)
    same = (np.abs(difference) < AGREE_M) & (far == np.isinf(ranges_m))
    assert same.mean() > SAME_SPOT


@needs_compiler
@given(seed=seeds)
@settings(deadline=None)
def test_compiled_walls_and_numpy_walls_are_the_same_walls(seed):
    rng = np.random.default_rng(seed)
    walls, circles = cluttered_walls(rng)
    by_c = SegmentGeometry(walls, circles)
    with compiled.numpy_only():
        by_numpy = SegmentGeometry(walls, circles)
    x, y, bearings = rng.uniform(-8, 8), rng.uniform(-7, 7), FAN_RAD + rng.uniform(-4, 4)
    assert_agree(by_c.cast(x, y, bearings), by_numpy.cast(x, y, bearings))
    many_x, many_y = x + rng.uniform(-0.1, 0.1, 1081), y + rng.uniform(-0.1, 0.1, 1081)
    shuffled = rng.permutation(bearings)
    assert_agree(by_c.cast(many_x, many_y, shuffled), by_numpy.cast(many_x, many_y, shuffled))


@needs_compiler
@given(seed=seeds)
@settings(deadline=None)
def test_compiled_cells_and_numpy_cells_are_the_same_cells(seed):
    rng = np.random.default_rng(seed)
    grid = GridGeometry(*cluttered_grid(rng))
    x, y = a_free_place(grid, rng)
    bearings = FAN_RAD + rng.uniform(-4, 4)
    assert_agree(grid.cast(x, y, bearings), grid.march(x, y, bearings))
    many_x, many_y = x + rng.uniform(-0.3, 0.3, 1081), y + rng.uniform(-0.3, 0.3, 1081)
    assert_agree(grid.cast(many_x, many_y, bearings), grid.march(many_x, many_y, bearings))


@needs_compiler
def test_any_array_of_numbers_will_do():
    grid = GridGeometry(np.zeros((50, 50), dtype=bool), 0.1, Pose(0, 0, 0))
    bearings = np.linspace(-3, 3, 201)
    expected = grid.cast(1.0, 2.0, bearings)
    np.testing.assert_allclose(grid.cast(1.0, 2.0, bearings.astype(np.float32)), expected, rtol=1e-4)
    frozen = bearings.copy()
    frozen.setflags(write=False)
    np.testing.assert_array_equal(grid.cast(1.0, 2.0, frozen), expected)
    np.testing.assert_array_equal(grid.cast(1.0, 2.0, np.repeat(bearings, 2)[::2]), expected)
    np.testing.assert_array_equal(grid.cast(np.float64(1.0), np.full(201, 2.0), bearings), expected)
    assert grid.cast(1.0, 2.0, np.array([])).shape == (0,)
    assert SegmentGeometry().cast(1.0, 2.0, np.array([])).shape == (0,)


@needs_compiler
def test_numbers_that_are_none_end_somewhere():
    grid = GridGeometry(np.zeros((50, 50), dtype=bool), 0.1, Pose(0, 0, 0))
    assert grid.cast(math.nan, 1.0, FAN_RAD).max() == 0.0
    assert grid.cast(math.inf, 1.0, FAN_RAD).max() == 0.0
    assert grid.cast(1.0, 1.0, np.full(3, math.nan)).shape == (3,)


@needs_compiler
@given(turns=st.integers(-50, 50), bearing=st.floats(-math.pi, math.pi))
def test_compiled_directions_are_as_good_as_the_libraries(turns, bearing):
    wall = SegmentGeometry(circles_m=np.array([[0.0, 0.0, 1.0]]), segments_m=chain(_polygon(), closed=True))
    with compiled.numpy_only():
        numpys = SegmentGeometry(chain(_polygon(), closed=True), np.array([[0.0, 0.0, 1.0]]))
    bearings = np.array([bearing + turns * math.tau])
    ranges = wall.cast(5.0, 0.0, bearings), numpys.cast(5.0, 0.0, bearings)
    assert ranges[0] == pytest.approx(ranges[1], rel=1e-9) or abs(math.sin(bearing)) == pytest.approx(0.2, abs=1e-6)


def _polygon():
    return [(20 * math.cos(angle), 20 * math.sin(angle)) for angle in np.linspace(0.1, 6.0, 7)]


def test_without_the_extension_numpy_answers(monkeypatch):
    def not_built(one):
        raise UnfitError("not built")

    monkeypatch.setattr(Accelerated, "compiled", not_built)
    monkeypatch.setattr(compiled, "_fitting", compiled._fitting.__wrapped__)
    assert compiled.by_c(cast_walls) is None
    assert SegmentGeometry(box(2, 0, 1, 1)).cast(0.0, 0.0, np.array([0.0]))[0] == pytest.approx(1.5)


def test_it_can_be_switched_off():
    with compiled.numpy_only():
        assert compiled.by_c(cast_walls) is None


@needs_compiler
def test_wrong_arguments_are_refused_and_crash_nothing():
    by_c: tuple[Any, Any] = compiled.by_c(cast_cells), compiled.by_c(cast_walls)
    bearing, ranges = np.zeros(4), np.empty(4)
    leaps, grid = np.zeros(4 * 6, np.uint16), (0.0, 0.0, 1.0, 0.0, 0.0, 0.1, 2.0, 3.0)
    by_c[0](leaps, grid, 0.0, 0.0, bearing, ranges)
    wrong: list[tuple[Any, ...]] = [
        (leaps[1:], grid, 0.0, 0.0, bearing, ranges),
        (leaps, (*grid[:6], math.nan, 3.0), 0.0, 0.0, bearing, ranges),
        (leaps, grid[:7], 0.0, 0.0, bearing, ranges),
        (leaps.astype(float), grid, 0.0, 0.0, bearing, ranges),
        (leaps, grid, 0.0, 0.0, bearing, ranges[1:]),
        (leaps, grid, np.zeros(3), np.zeros(3), bearing, ranges),
        (leaps, grid, np.zeros(4), 0.0, bearing, ranges),
        (leaps, grid, 0.0, 0.0, np.zeros(8)[::2], ranges),
        (leaps, grid, 0.0, 0.0),
    ]
    for given_ in wrong:
        with pytest.raises((TypeError, ValueError)):
            by_c[0](*given_)
    circles, straight = np.zeros(3), np.zeros(10)
    by_c[1](straight, circles, 0.0, 0.0, bearing, ranges)
    for walls in ((straight[1:], circles), (straight, circles[1:]), (None, circles), (np.zeros((2, 5)), circles)):
        with pytest.raises((TypeError, ValueError)):
            by_c[1](*walls, 0.0, 0.0, bearing, ranges)


@needs_compiler
def test_a_bearing_that_is_no_angle_has_no_distance():
    walls = SegmentGeometry(box(2, 0, 1, 1))
    bearings = np.array([math.nan, math.inf, -1e300, 0.0])
    assert np.isnan(walls.cast(0.0, 0.0, bearings)).tolist() == [True, True, True, False]


def test_many_places_at_once_are_the_places_one_by_one():
    rng = np.random.default_rng(4)
    grid = GridGeometry(*cluttered_grid(rng))
    places = [a_free_place(grid, rng) for _ in range(5)]
    x, y = np.array(places).T
    together = grid.cast(np.repeat(x, 1081), np.repeat(y, 1081), np.tile(FAN_RAD, 5)).reshape(5, 1081)
    for (px, py), ranges in zip(places, together, strict=True):
        assert_agree(grid.cast(px, py, FAN_RAD), ranges)
