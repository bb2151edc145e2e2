"""The way of a ball along drawn walls: closed, beside them, and ending where a car cannot turn."""

import numpy as np
import pytest
from scipy import ndimage

from wallride.sim.world.ball_contour import ENDLESS_M, led_on, places

CELL_M = 0.05
BOTH_SIDES = pytest.mark.parametrize("side", ["left", "right"])


def rolled(rooms, ball_m, side="left", size_m=(20.0, 10.0)):
    """A ball's way in a map whose free floor is made of rectangles (x0, y0, x1, y1) [m]."""
    solid = np.ones([round(side_m / CELL_M) for side_m in size_m[::-1]], dtype=bool)
    for room in rooms:
        x0, y0, x1, y1 = (round(edge_m / CELL_M) for edge_m in room)
        solid[y0:y1, x0:x1] = False
    away_m = np.round(ndimage.distance_transform_edt(~solid) * CELL_M, 6)
    return places(away_m, CELL_M, ball_m, side), away_m


def at(way, x_m, y_m):
    """The index of the place nearest to a point."""
    middle_m = (way.cell[:, ::-1] + 0.5) * CELL_M
    return int(np.argmin(((middle_m - (x_m, y_m)) ** 2).sum(axis=1)))


@BOTH_SIDES
def test_a_large_room_is_driven_round_for_ever_with_the_wall_on_the_side(side):
    way, away_m = rolled([(1, 1, 19, 9)], 1.0, side)
    assert (way.way_m == ENDLESS_M).all()
    assert away_m[tuple(way.cell.T)] == pytest.approx(1.0)
    east_or_west = 1.0 if side == "right" else -1.0
    assert way.heading[at(way, 10.0, 2.0)] == pytest.approx((east_or_west, 0.0), abs=1e-9)
    assert way.heading[at(way, 10.0, 8.0)] == pytest.approx((-east_or_west, 0.0), abs=1e-9)


@BOTH_SIDES
def test_a_narrow_corridor_ends_and_the_way_counts_down_to_its_end(side):
    way, _ = rolled([(1, 4, 19, 5.7)], 0.8, side)
    there = way.heading[:, 0] > 0.99
    end_m = (way.cell[:, 1] + 0.5) * CELL_M + way.way_m
    middle = np.abs((way.cell[:, 1] + 0.5) * CELL_M - 10.0) < 6.0
    assert end_m[there & middle] == pytest.approx(18.2, abs=1.0)
    assert way.way_m.max() < 17.0
    assert not way.way_m.min()


def test_a_corridor_wide_enough_to_turn_in_does_not_end():
    assert (rolled([(1, 2, 19, 7)], 1.0)[0].way_m == ENDLESS_M).all()
    assert rolled([(1, 2, 19, 5)], 1.0)[0].way_m.max() < 20.0


@pytest.mark.parametrize(("depth_m", "endless"), [(1.0, True), (3.0, False)])
def test_a_niche_is_passed_and_a_side_corridor_is_a_dead_end(depth_m, endless):
    walled = [(1, 2, 19, 6), (9, 6, 10.7, 6 + depth_m)]
    assert (rolled(walled, 0.8)[0].way_m.max() == ENDLESS_M) == endless


@pytest.mark.parametrize(("radius_m", "drivable"), [(0.1, False), (0.6, True)])
def test_a_ring_must_be_as_long_as_the_tightest_circle(radius_m, drivable):
    size = np.arange(0.0, 10.0, CELL_M)
    away_m = np.round(np.hypot(*np.meshgrid(size - 5.0, size - 5.0)) - radius_m, 6)
    away_m[[0, -1]] = away_m[:, [0, -1]] = 0.0
    way = places(away_m, CELL_M, 0.5, "left")
    ring = np.hypot(*((way.cell + 0.5) * CELL_M - 5.0).T) < 2.0
    assert (way.way_m[ring] == (ENDLESS_M if drivable else 0.0)).all()


def test_a_way_one_cell_wide_and_oblique_hangs_together():
    away_m = np.zeros((200, 200))
    diagonal = np.arange(10, 190)
    away_m[diagonal, diagonal] = 1.0
    way = places(away_m, CELL_M, 1.0, "left")
    assert way.way_m.max() == pytest.approx(180 * CELL_M * np.sqrt(2) - 1.5, abs=0.3)


@BOTH_SIDES
def test_a_law_that_comes_nearer_passes_a_narrow_place_but_no_dead_end(side):
    bottleneck = [(1, 3, 5, 7), (5, 3.9, 8, 6.1), (8, 4.2, 12, 5.8), (12, 3.9, 15, 6.1), (15, 3, 19, 7)]
    (wide, _), (near, _) = (rolled(bottleneck, ball_m, side) for ball_m in (1.0, 0.7))
    assert wide.way_m.max() < 30.0
    assert (near.way_m == ENDLESS_M).all()
    assert (led_on(wide, near, CELL_M).way_m == ENDLESS_M).mean() > 0.7
    dead_end = [(1, 4, 19, 6.1)]
    (wide, _), (near, _) = (rolled(dead_end, ball_m, side) for ball_m in (1.0, 0.7))
    assert led_on(wide, near, CELL_M).way_m.max() < wide.way_m.max() + 2.0


def test_ways_end_where_the_turn_begins():
    way, _ = rolled([(1, 4, 19, 5.7)], 0.8)
    east, west = (at(way, x_m, 4.85) for x_m in (10.0, 9.0))
    for place in (east, west):
        ahead_m = (way.cell[way.end[place]] - way.cell[place])[::-1] * CELL_M @ way.heading[place]
        assert ahead_m == pytest.approx(way.way_m[place], abs=0.3)
