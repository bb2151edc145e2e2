"""Walls made of cells give the same answers as the same walls made of segments."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.place import World
from wallride.sim.world.pose import CAR, Pose
from wallride.sim.world.segments import SegmentGeometry, box, chain

CELL_M = 0.05
FAN_RAD = np.radians(np.linspace(-135.0, 135.0, 1081))


def room() -> tuple[GridGeometry, SegmentGeometry]:
    """A room of 8 x 5 m with a box of 1 x 0.5 m in it, its corner at (3, 2), both ways."""
    solid = np.zeros((100, 160), dtype=bool)
    solid[40:50, 60:80] = True
    walls = np.vstack([chain([(0, 0), (8, 0), (8, 5), (0, 5)], closed=True), box(3.5, 2.25, 1.0, 0.5)])
    return GridGeometry(solid, CELL_M, Pose(0, 0, 0)), SegmentGeometry(walls)


GRID, SEGMENTS = room()
free_places = st.tuples(st.floats(0.3, 7.7), st.floats(0.3, 4.7)).filter(
    lambda at: not (2.99 <= at[0] <= 4.01 and 1.99 <= at[1] <= 2.51)
)


@given(at=free_places, yaw=st.floats(-4, 4))
def test_beams_end_exactly_on_the_wall_not_half_a_cell_away(at, yaw):
    x, y = at
    difference = GRID.cast(x, y, FAN_RAD + yaw) - SEGMENTS.cast(x, y, FAN_RAD + yaw)
    # A beam that grazes the box's corner to within rounding may see either side of it.
    close = np.abs(difference) < 1e-6
    assert close.mean() > 0.998
    assert math.sqrt(float((difference[close] ** 2).mean())) < 1e-6


@pytest.mark.parametrize("bearing", [0.0, -0.0, math.pi / 2, -math.pi / 2, math.pi, -math.pi])
def test_beams_along_the_grid_lines(bearing):
    for x, y in ((1.0, 1.0), (1.025, 1.025), (1.0, 1.01)):
        expected = {0.0: 8 - x, math.pi / 2: 5 - y, -math.pi / 2: y}.get(bearing, x)
        assert GRID.cast(x, y, np.array([bearing]))[0] == pytest.approx(expected, abs=1e-9)


@given(x=st.floats(0.0, 8.0), y=st.floats(0.0, 5.0), yaw=st.floats(-4, 4))
def test_clearance_agrees_with_segments(x, y, yaw):
    pose = Pose(x, y, yaw)
    if GRID.is_free(x, y):
        assert GRID.clearance(pose, CAR) == pytest.approx(SEGMENTS.clearance(pose, CAR), abs=1e-9)
    else:
        assert GRID.clearance(pose, CAR) == 0.0


def test_inside_walls_and_outside_the_map_everything_is_contact():
    assert GRID.cast(3.5, 2.25, FAN_RAD).max() == 0.0
    assert GRID.cast(-20.0, 1.0, FAN_RAD).max() == 0.0
    assert GRID.clearance(Pose(-20.0, 1.0, 0.0), CAR) == 0.0
    assert not GRID.is_free(-20.0, 1.0)


def test_a_turned_map_turns_its_walls():
    turn = Pose(2.0, -1.0, 0.7)
    turned = GridGeometry(GRID.solid[1:-1, 1:-1], CELL_M, turn)
    at = turn.ahead(1.3, 2.1)
    np.testing.assert_allclose(turned.cast(at.x_m, at.y_m, FAN_RAD + 0.7), GRID.cast(1.3, 2.1, FAN_RAD), atol=1e-9)
    car = turn.ahead(0.4, 0.3)
    assert turned.clearance(Pose(car.x_m, car.y_m, 1.0), CAR) == pytest.approx(GRID.clearance(Pose(0.4, 0.3, 0.3), CAR))


def test_mirrored_and_drawn():
    turn = Pose(2.0, -1.0, 0.7)
    turned = GridGeometry(GRID.solid[1:-1, 1:-1], CELL_M, turn)
    at = turn.ahead(1.3, 2.1)
    np.testing.assert_allclose(
        turned.mirrored().cast(at.x_m, -at.y_m, -FAN_RAD), turned.cast(at.x_m, at.y_m, FAN_RAD), atol=1e-9
    )
    drawn = {tuple(np.round(line, 9)) for line in GRID.outline_m}
    assert len(drawn) == 8
    assert (3.0, 2.0, 4.0, 2.0) in drawn
    assert World("", GRID, Pose(0.0, 0.0, 0.0)).bounds_m == pytest.approx((0.0, 0.0, 8.0, 5.0))


@given(seed=st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_in_random_clutter_every_beam_ends_at_the_first_solid_cell(seed):
    rng = np.random.default_rng(seed)
    solid = rng.random((40, 40)) < 0.1
    solid[20, 20] = False
    grid = GridGeometry(solid, 1.0, Pose(0, 0, 0))
    x, y = 20 + rng.random(), 20 + rng.random()
    bearings = rng.uniform(-math.pi, math.pi, 60)
    distances = grid.cast(x, y, bearings)
    for bearing, distance in zip(bearings, distances, strict=True):
        dx, dy = math.cos(bearing), math.sin(bearing)
        before = np.arange(0, distance, 0.01)[:-1]
        assert not any(grid.solid[int(y + dy * s) + 1, int(x + dx * s) + 1] for s in before)
        just_in = distance + 1e-6
        assert grid.solid[math.floor(y + dy * just_in) + 1, math.floor(x + dx * just_in) + 1]
