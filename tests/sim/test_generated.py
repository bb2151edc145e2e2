"""Rooms and tracks made from a seed, and the truth whether a way on exists in them."""

import math

import numpy as np
import pytest

from wallride.sim.virtual.way_on import AWAY_M, way_on
from wallride.sim.world.floor_plan import FloorPlan
from wallride.sim.world.generated_rooms import BLUNTEST_DEG, KINDS, SHARPEST_DEG, generated_room, kind_of
from wallride.sim.world.generated_tracks import generated_track
from wallride.sim.world.lap import LapCounter
from wallride.sim.world.pose import CAR, Pose
from wallride.sim.world.segments import SegmentGeometry, box, chain


@pytest.mark.parametrize("build", [generated_room, generated_track])
def test_the_same_seed_gives_the_same_world_and_another_one_another(build):
    first, again, other = build(5), build(5), build(6)
    assert np.array_equal(first.outline_m, again.outline_m)
    assert first.outline_m.shape != other.outline_m.shape or not np.array_equal(first.outline_m, other.outline_m)


def test_every_kind_of_room_is_made():
    assert {kind_of(seed) for seed in range(19)} == set(KINDS)
    assert (BLUNTEST_DEG, SHARPEST_DEG) == (60.0, 150.0)


@pytest.mark.parametrize("seed", range(0, 60, 7))
def test_a_room_is_closed_and_the_car_starts_free_beside_its_wall(seed):
    room = generated_room(seed)
    assert np.isfinite(room.cast(room.start.x_m, room.start.y_m, np.linspace(0.0, math.tau, 720))).all()
    assert room.clearance(room.start) > 0.1
    assert room.wall_distance_m(room.start) <= 3.0  # a lane that crosses may have opened it just there


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("inner", [False, True])
def test_a_track_can_be_driven_round_along_its_middle(seed, inner):
    track = generated_track(seed, inner=inner)
    assert track.lap is not None
    assert track.clearance(track.start) > 0.1
    corners = track.lap.points_m
    counter = LapCounter(track.lap)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        for x_m, y_m in start + np.linspace(0.0, 1.0, 20)[:, None] * (end - start):
            assert track.wall_distance_m(Pose(float(x_m), float(y_m), 0.0)) > 0.2
            counter.update(float(x_m), float(y_m))
    assert counter.laps == pytest.approx(1.0, abs=0.05)
    ahead = track.start.ahead(0.5)
    moved = LapCounter(track.lap)
    moved.update(track.start.x_m, track.start.y_m)
    assert moved.update(ahead.x_m, ahead.y_m) > 0


def test_pieces_of_floor_that_overlap_have_no_wall_between_them():
    plan = FloorPlan()
    end = plan.lane(Pose(0.0, 0.0, 0.0), 4.0, 2.0)
    plan.lane(Pose(end.x_m - 1.0, 0.0, math.pi / 2), 5.0, 2.0)
    geometry = SegmentGeometry(plan.walls_m())
    (up,) = geometry.cast(3.0, 0.0, np.array([math.pi / 2]))
    (back,) = geometry.cast(3.0, 0.0, np.array([math.pi]))
    (aside,) = geometry.cast(1.0, 0.0, np.array([math.pi / 2]))
    assert (up, back, aside) == pytest.approx((5.0, 3.0, 1.0))


def lane(width_m, *, length_m=12.0, end_m=0.6):
    """A lane along x, closed end_m before the rear axle, open far behind it."""
    half_m = width_m / 2
    return chain([(end_m - length_m, half_m), (end_m, half_m), (end_m, -half_m), (end_m - length_m, -half_m)])


STANDS = Pose(0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("walls", "exists"),
    [
        (lane(1.5), True),
        (lane(0.5), False),  # it could back out, but never comes away forward
        (lane(1.5, length_m=2.0), True),
        (box(0.2, 0.0, 1.2, 0.8), False),
        (np.vstack([box(0.75, 0.0, 0.5, 0.3), box(0.0, 0.0, 20.0, 20.0)]), True),
    ],
)
def test_whether_a_way_on_exists(walls, exists):
    found = way_on(SegmentGeometry(walls), STANDS)
    assert found.exists is exists
    assert math.isnan(found.length_m) is not exists
    if exists:
        assert found.length_m >= AWAY_M


def test_a_gap_narrower_than_the_car_is_no_way_and_a_wider_one_is():
    def cell(gap_m):
        hole = [(-1.0, gap_m / 2), (-1.0, 0.5), (1.6, 0.5), (1.6, -0.5), (-1.0, -0.5), (-1.0, -gap_m / 2)]
        return SegmentGeometry(chain(hole))

    turned = Pose(0.6, 0.0, math.pi)
    assert way_on(cell(2 * CAR.half_width_m + 0.2), turned).exists
    assert not way_on(cell(2 * CAR.half_width_m - 0.02), turned).exists
