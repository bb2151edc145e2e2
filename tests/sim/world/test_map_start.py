"""The start on a map is beside a wall that leads on, however far one sees into a dead end."""

import math

import numpy as np
import pytest

from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.map_start import choose_start
from wallride.sim.world.pose import Pose, side_sign

CELL_M = 0.05
BOTH_SIDES = pytest.mark.parametrize("side", ["left", "right"])


def drawn(rooms, origin=None):
    """A map whose free floor is made of rectangles (x0, y0, x1, y1) [m]."""
    cells = np.round(np.array(rooms) / CELL_M).astype(int)
    solid = np.ones((cells[:, 3].max() + 5, cells[:, 2].max() + 5), dtype=bool)
    for x0, y0, x1, y1 in cells:
        solid[y0:y1, x0:x1] = False
    return GridGeometry(solid, CELL_M, origin or Pose(0.0, 0.0, 0.0))


def loop_with_a_dead_end(width_m):
    """A corridor round a block of 5 x 4 m at (10, 3), and one as wide that leads to it from 9 m away."""
    near, far_x, far_y = 10.0 - width_m, 15.0 + width_m, 7.0 + width_m
    return [
        (near, 3.0 - width_m, far_x, 3.0), (near, 7.0, far_x, far_y), (near, 3.0, 10.0, 7.0), (15.0, 3.0, far_x, 7.0),
        (1.0, 3.0 - width_m, near, 3.0),
    ]  # fmt: skip


def followed(geometry, pose, side):
    """The point of the wall beside a pose, in the drawing's frame."""
    bearing = pose.yaw_rad + side_sign(side) * math.pi / 2
    range_m = float(geometry.cast(pose.x_m, pose.y_m, np.array([bearing]))[0])
    return pose.x_m + range_m * math.cos(bearing), pose.y_m + range_m * math.sin(bearing)


@BOTH_SIDES
@pytest.mark.parametrize("width_m", [2.1, 1.4])
def test_the_loop_is_chosen_and_not_the_dead_end(width_m, side):
    geometry = drawn(loop_with_a_dead_end(width_m))
    start, room_m = choose_start(geometry, side)
    x_m, y_m = followed(geometry, start, side)
    assert 9.9 < x_m < 15.1, "not the wall of the block"
    assert 2.9 < y_m < 7.1, "not the wall of the block"
    assert room_m == {2.1: 1.0, 1.7: 0.8, 1.4: 0.7}[width_m]
    assert math.dist((x_m, y_m), (start.x_m, start.y_m)) == pytest.approx(room_m, abs=1.5 * CELL_M)
    assert choose_start(drawn(loop_with_a_dead_end(width_m)), side) == (start, room_m)


@BOTH_SIDES
def test_a_turned_map_has_the_same_start_turned(side):
    origin = Pose(3.0, -2.0, 0.7)
    plain, _ = choose_start(drawn(loop_with_a_dead_end(1.7)), side)
    turned, _ = choose_start(drawn(loop_with_a_dead_end(1.7), origin), side)
    x_m, y_m = followed(drawn(loop_with_a_dead_end(1.7), origin), turned, side)
    dx, dy = x_m - 3.0, y_m + 2.0
    assert 9.9 < math.cos(0.7) * dx + math.sin(0.7) * dy < 15.1
    assert 2.9 < math.cos(0.7) * dy - math.sin(0.7) * dx < 7.1
    off_axis_rad = math.remainder(turned.yaw_rad - 0.7 - plain.yaw_rad, math.pi / 2)
    assert off_axis_rad == pytest.approx(0.0, abs=0.02)


def test_the_distance_stays_1_m_where_less_would_not_lead_much_farther():
    start, room_m = choose_start(drawn([(1, 1, 13, 3.1), (13, 1.5, 14.5, 3.0)]), "left")  # a narrower end
    assert room_m == 1.0
    assert abs(math.sin(start.yaw_rad)) < 0.02


@BOTH_SIDES
def test_a_map_too_narrow_for_any_distance_still_has_a_start(side):
    geometry = drawn([(1, 1, 9, 1.6)])
    start, room_m = choose_start(geometry, side)
    assert room_m == pytest.approx(0.3)
    assert geometry.is_free(start.x_m, start.y_m)
    assert abs(math.sin(start.yaw_rad)) < 0.02
