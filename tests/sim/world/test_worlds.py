"""The built-in worlds are what their docstrings say, on both sides."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wallride.sim.world.lap import LapCounter
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import BUILDERS, load_world

BOTH_SIDES = pytest.mark.parametrize("side", ["left", "right"])
EVERY_WORLD = pytest.mark.parametrize("name", BUILDERS)
SIGN = {"left": 1.0, "right": -1.0}


@EVERY_WORLD
@BOTH_SIDES
def test_every_world_starts_1_m_from_its_wall_with_room_for_the_car(name, side):
    world = load_world(name, side=side)
    assert world.side == side
    assert world.wall_distance_m(world.start) == pytest.approx(1.0, abs=1e-9)
    assert world.clearance(world.start) == pytest.approx(0.85, abs=1e-9)
    assert not world.collides(world.start)
    assert len(world.description) > 20


@EVERY_WORLD
def test_the_right_hand_world_is_the_mirror_image(name):
    left, right = load_world(name), load_world(name, side="right")
    fan = np.radians(np.linspace(-135, 135, 271))
    np.testing.assert_allclose(
        right.cast(right.start.x_m, right.start.y_m, right.start.yaw_rad - fan),
        left.cast(left.start.x_m, left.start.y_m, left.start.yaw_rad + fan),
    )


def look(world, forward_m, left_m, degrees):
    """Distance from a place near the start in a direction of the starting car; left is toward the followed wall."""
    sign = SIGN[world.side]
    at = world.start.ahead(forward_m, sign * left_m)
    bearing = world.start.yaw_rad + sign * math.radians(degrees)
    return float(world.cast(at.x_m, at.y_m, np.array([bearing]))[0])


@pytest.mark.parametrize(
    ("name", "forward_m", "left_m", "degrees", "expected_m"),
    [
        ("straight", 30, 0, -90, 3.0),
        ("corridor", 30, 0, -90, 1.0),
        ("loop", 0, 0, 0, 9.0),
        ("loop", 0, 0, -90, 1.0),
        ("loop_inner", 0, 0, -90, 1.0),
        ("loop_inner", 0, 0, 0, 9.0),
        ("inside_corner", 0, 0, 0, 8.0),
        ("inside_corner", 7, -10, 90, 11.0),
        ("outside_corner", 0, 0, 0, math.inf),
        ("outside_corner", 7, 10, 180, 1.0),
        ("doorway", 7.5, 0, 90, 4.0),
        ("doorway", 6.9, 0, 90, 1.0),
        ("doorway", 8.1, 0, 90, 1.0),
        ("l_turn", 7, 0, -90, math.inf),
        ("l_turn", 7, -10, 180, 1.0),
        ("l_turn_inner", 7, 10, 180, 1.0),
        ("l_turn_inner", 7, 10, 0, 1.0),
        ("u_turn", 7, 0, -90, 3.1),
        ("u_turn", 0, -2.1, -90, 1.0),
        ("u_turn", 0, -2.1, 90, 1.0),
        ("u_turn_inner", 7, 0, 90, 3.1),
        ("u_turn_inner", 0, 2.1, 90, 1.0),
        ("curved", 0, 0, -90, 1.5),
        ("dead_end", 0, 0, 0, 12.0),
        ("cluttered", 0, 0, 180, 2.5),
    ],
)
@BOTH_SIDES
def test_dimensions(name, forward_m, left_m, degrees, expected_m, side):
    assert look(load_world(name, side=side), forward_m, left_m, degrees) == pytest.approx(expected_m)


@pytest.mark.parametrize("name", ["loop", "loop_inner"])
@BOTH_SIDES
def test_a_drive_along_the_middle_of_the_loop_is_one_lap(name, side):
    world = load_world(name, side=side)
    assert world.lap is not None
    ring = world.lap.points_m
    assert world.lap.length_m == pytest.approx(30.3, abs=0.05)
    assert world.lap.progress_m(world.start.x_m, world.start.y_m) == pytest.approx(0.0)
    assert math.atan2(*(ring[1] - ring[0])[::-1]) == pytest.approx(world.start.yaw_rad)
    counter = LapCounter(world.lap)
    for (x, y), (next_x, next_y) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        counter.update(x, y)
        here = Pose(x, y, math.atan2(next_y - y, next_x - x))
        # 1 m everywhere but round the outer corners, where the bend of 1 m radius keeps off up to sqrt(2)
        assert 0.98 < world.wall_distance_m(here) < 1.42
    assert counter.update(*ring[0]) == pytest.approx(1.0)


@BOTH_SIDES
def test_starts_can_be_moved_and_turned_toward_the_wall(side):
    world = load_world("straight", side=side)
    near = world.start_at(distance_m=0.5, toward_wall_rad=0.3)
    assert world.wall_distance_m(near) == pytest.approx(0.5)
    ahead = near.ahead(1.0)
    assert world.wall_distance_m(Pose(ahead.x_m, ahead.y_m, world.start.yaw_rad)) == pytest.approx(0.5 - math.sin(0.3))


@BOTH_SIDES
def test_a_start_nearer_to_its_wall_is_moved_from_there(side):
    world = load_world("straight", side=side)
    near = replace(world, start=world.start_at(distance_m=0.7), room_m=0.7)
    assert near.start_at() == near.start
    assert near.wall_distance_m(near.start_at(distance_m=0.5)) == pytest.approx(0.5)
    mirrored = near.mirrored()
    assert mirrored.room_m == 0.7
    assert mirrored.wall_distance_m(mirrored.start_at(distance_m=1.2)) == pytest.approx(1.2)


def test_the_side_without_a_wall_is_infinitely_far():
    world = load_world("outside_corner")
    assert math.isinf(world.wall_distance_m(Pose(0, 0, 0), "right"))


def test_a_wall_seen_edge_on_from_its_own_line_is_not_there():
    # From (-4, 3) the inner wall along x = -4 lies exactly behind a beam to +y: rounding once put it at 0 m.
    world = load_world("loop")
    assert world.wall_distance_m(Pose(-4.0, 3.0, 0.0)) == pytest.approx(1.0)


def test_the_way_through_the_curve_is_as_wide_as_it_says():
    world = load_world("curved")
    x, y = 4.5 + 4.25 * math.sin(math.pi / 4), 4.0 - 4.25 * math.cos(math.pi / 4)  # middle of the first bend
    assert world.clearance(Pose(x, y, math.pi / 4)) > 0


@pytest.mark.parametrize("seed", range(6))
def test_clutter_is_repeatable_and_leaves_the_start_free(seed):
    first, again, other = (load_world("cluttered", seed=number) for number in (seed, seed, seed + 1))
    np.testing.assert_array_equal(first.outline_m, again.outline_m)
    assert not np.array_equal(first.outline_m, other.outline_m)
    assert first.clearance(first.start) > 0.8


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(ValueError, match=r"'lop'.*straight.*loop.*dead_end"):
        load_world("lop")


def test_a_missing_map_says_so():
    with pytest.raises(FileNotFoundError, match=r"nowhere\.yaml"):
        load_world("nowhere.yaml")
    with pytest.raises(FileNotFoundError):
        load_world(Path("nowhere"))
