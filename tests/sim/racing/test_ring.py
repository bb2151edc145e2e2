"""The way round a course: from its own lap, from the wall on a map, from a path in a file."""

import numpy as np
import pytest

from wallride.sim.racing.ring import NoRingError, even, read_path, ring_length_m, ring_of, ring_of_path
from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import load_world

CELL_M = 0.05
HOME = Pose(0.0, 0.0, 0.0)


def circle(radius_m, turns=1.0, count=200):
    angle_rad = np.linspace(0.0, 2 * np.pi * turns, count)
    return radius_m * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])


def on_a_map(rooms, start, side, origin=HOME):
    """A world of free rectangles x0, y0, x1, y1 less an island in its middle, as a grid of 20 x 10 m."""
    solid = np.ones((round(10.0 / CELL_M), round(20.0 / CELL_M)), dtype=bool)
    for x0, y0, x1, y1, is_solid in rooms:
        solid[round(y0 / CELL_M) : round(y1 / CELL_M), round(x0 / CELL_M) : round(x1 / CELL_M)] = is_solid
    return World("drawn", GridGeometry(solid, CELL_M, origin), start, side)


RING = [(1, 1, 19, 9, False), (4, 4, 16, 6, True)]


def area_m2(ring_m):
    """Signed: above 0 where the ring goes counter-clockwise."""
    after = np.roll(ring_m, -1, axis=0)
    return 0.5 * float((ring_m[:, 0] * after[:, 1] - ring_m[:, 1] * after[:, 0]).sum())


def test_a_course_has_its_own_lap():
    world = load_world("track:seed=3")
    assert world.lap is not None
    assert ring_length_m(ring_of(world)) == pytest.approx(world.lap.length_m, rel=0.02)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.6])
@pytest.mark.parametrize(("side", "turns"), [("left", -1), ("right", 1)])
def test_on_a_map_the_wall_on_the_side_leads_round(side, turns, yaw_rad):
    """Along the outer wall: with it on the left the car drives clockwise."""
    origin = Pose(3.0, -2.0, yaw_rad)
    ring_m = ring_of(on_a_map(RING, origin.ahead(10.0, 2.0), side, origin))
    assert np.sign(area_m2(ring_m)) == turns
    dx, dy = (ring_m - [origin.x_m, origin.y_m]).T
    x_m, y_m = np.cos(yaw_rad) * dx + np.sin(yaw_rad) * dy, np.cos(yaw_rad) * dy - np.sin(yaw_rad) * dx
    outside_m = np.minimum(np.minimum(x_m - 1, 19 - x_m), np.minimum(y_m - 1, 9 - y_m))
    assert outside_m.min() == pytest.approx(1.0, abs=0.1)
    assert outside_m.max() < 1.3


def test_a_dead_end_is_no_ring_and_the_error_says_what_to_give():
    world = on_a_map([(1, 4, 19, 5.7, False)], Pose(10.0, 4.8, 0.0), "left")
    with pytest.raises(NoRingError, match="--path"):
        ring_of(world)
    with pytest.raises(NoRingError, match="no lap"):
        ring_of(load_world("straight"))


def test_a_path_that_overlaps_its_beginning_is_one_lap():
    assert ring_length_m(ring_of_path(circle(3.0, turns=1.2), what="it")) == pytest.approx(6 * np.pi, rel=0.01)


def test_a_path_that_does_not_come_back_is_refused_with_the_gap():
    with pytest.raises(NoRingError, match=r"it ends 4\.2 m from it"):
        ring_of_path(circle(3.0, turns=0.75), what="it")
    with pytest.raises(NoRingError, match="finite"):
        ring_of_path(np.full((9, 2), np.nan), what="it")


def test_points_are_evenly_spaced_and_a_tiny_lap_is_refused():
    ring_m = even(circle(4.0, count=37)[:-1])
    steps_m = np.hypot(*(np.roll(ring_m, -1, axis=0) - ring_m).T)
    assert steps_m == pytest.approx(0.2, abs=0.01)
    with pytest.raises(NoRingError, match="tightest circle"):
        even(circle(0.8)[:-1])


@pytest.mark.parametrize(
    "text",
    [
        "# x_m, y_m, w_tr_right_m\n1.0, 2.0, 0.9\n3.0, 4.0, 0.9\n",
        "# by a program\n# s_m; x_m; y_m; psi_rad\n0.0; 1.0; 2.0; 0.1\n0.5; 3.0; 4.0; 0.1\n",
        "1 2\n\n3 4\n",
    ],
    ids=["centre line", "race line", "plain"],
)
def test_files_of_paths_are_read_by_their_columns(tmp_path, text):
    (tmp_path / "path.csv").write_text(text)
    assert read_path(tmp_path / "path.csv").tolist() == [[1.0, 2.0], [3.0, 4.0]]


def test_a_row_without_numbers_is_named(tmp_path):
    (tmp_path / "path.csv").write_text("1, 2\nx, y\n")
    with pytest.raises(NoRingError, match="line 2"):
        read_path(tmp_path / "path.csv")
