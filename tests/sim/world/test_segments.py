"""Exact answers for walls made of segments and circles, against geometry done by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wallride.sim.world.pose import CAR, Pose
from wallride.sim.world.segments import SegmentGeometry, box, chain

FAN_RAD = np.radians(np.linspace(-135.0, 135.0, 1081))


def test_a_long_wall_is_as_far_as_the_cosine_says():
    wall = SegmentGeometry(np.array([[-1000.0, 2.0, 1000.0, 2.0]]))
    distance = wall.cast(0.3, 0.5, FAN_RAD)
    toward = np.sin(FAN_RAD) > 0.01
    np.testing.assert_allclose(distance[toward], 1.5 / np.sin(FAN_RAD[toward]), rtol=1e-12)
    assert np.isinf(distance[np.sin(FAN_RAD) <= 0]).all()


def test_a_circle_from_outside_beside_and_inside():
    pole = SegmentGeometry(circles_m=np.array([[3.0, 0.0, 0.5]]))
    ahead, off_axis, past, behind = pole.cast(0.0, 0.0, np.array([0.0, 0.1, 0.2, math.pi]))
    assert ahead == pytest.approx(2.5)
    assert off_axis == pytest.approx(3 * math.cos(0.1) - math.sqrt(0.25 - (3 * math.sin(0.1)) ** 2))
    assert math.isinf(past)
    assert math.isinf(behind)
    assert pole.cast(3.1, 0.0, np.array([1.0]))[0] == 0.0


def test_no_beam_slips_through_a_corner():
    room = SegmentGeometry(chain([(0, 0), (4, 0), (4, 3), (0, 3)], closed=True))
    corners = np.array([math.atan2(y - 1, x - 1) for x, y in ((0, 0), (4, 0), (4, 3), (0, 3))])
    expected = [math.hypot(x - 1, y - 1) for x, y in ((0, 0), (4, 0), (4, 3), (0, 3))]
    np.testing.assert_allclose(room.cast(1.0, 1.0, corners), expected, rtol=1e-9)


def test_each_beam_may_have_its_own_origin():
    wall = SegmentGeometry(np.array([[-10.0, 2.0, 10.0, 2.0]]))
    distance = wall.cast(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 1.0]), np.full(3, math.pi / 2))
    np.testing.assert_allclose(distance, [2.0, 1.5, 1.0])


@pytest.mark.parametrize(
    ("segment", "expected_m"),
    [
        ([-5, 1, 5, 1], 0.85),  # alongside: half width 0.15
        ([1, -5, 1, 5], 0.58),  # across, ahead of the bumper at 0.42
        ([-5, 0.1, 5, 0.1], 0.0),  # right through
        ([0.0, 0.0, 0.1, 0.1], 0.0),  # wholly inside the outline
        ([0.42, 0.15, 2, 2], 0.0),  # touches the corner
        ([0.72, 0.55, 5, 5], 0.5),  # a 3-4-5 triangle from the corner
        ([-0.13 - 0.3, 0.15 + 0.4, -5, 5], 0.5),
        ([-5, 0, 5, 0], 0.0),  # through the middle, both ways
        ([0.145, -5, 0.145, 5], 0.0),
    ],
)
def test_clearance_of_the_outline_by_hand(segment, expected_m):
    geometry = SegmentGeometry(np.array([segment], dtype=float))
    assert geometry.clearance(Pose(0, 0, 0), CAR) == pytest.approx(expected_m, abs=1e-9)


def test_clearance_to_a_pole_is_from_its_skin():
    assert SegmentGeometry(circles_m=np.array([[1.42, 0.0, 0.1]])).clearance(Pose(0, 0, 0), CAR) == pytest.approx(0.9)


def test_nothing_is_infinitely_far():
    nothing = SegmentGeometry()
    assert math.isinf(nothing.clearance(Pose(0, 0, 0), CAR))
    assert np.isinf(nothing.cast(0.0, 0.0, FAN_RAD)).all()


@given(
    x=st.floats(-4, 4), y=st.floats(-4, 4), yaw=st.floats(-4, 4), bx=st.floats(-3, 3), by=st.floats(-3, 3),
    turn=st.floats(0, 3),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_clearance_agrees_with_points_along_both_outlines(x, y, yaw, bx, by, turn):
    pose = Pose(x, y, yaw)
    walls = box(bx, by, 1.0, 0.6, turn)
    share = np.linspace(0, 1, 201)[:, None]
    wall_points = np.vstack([(1 - share) * wall[:2] + share * wall[2:] for wall in walls])
    corners = CAR.corners()
    outline = np.vstack(
        [(1 - share) * a + share * b for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )
    cos, sin = math.cos(yaw), math.sin(yaw)
    car_points = np.column_stack(
        [x + cos * outline[:, 0] - sin * outline[:, 1], y + sin * outline[:, 0] + cos * outline[:, 1]]
    )
    sampled = np.hypot(*(wall_points[:, None] - car_points[None]).transpose(2, 0, 1)).min()
    exact = SegmentGeometry(walls).clearance(pose, CAR)
    assert exact <= sampled + 1e-9
    if exact > 0:
        assert sampled - exact < 0.005
    else:
        touching_or_inside = sampled < 0.005 or _inside(wall_points, pose)
        assert touching_or_inside


def _inside(points, pose):
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    dx, dy = points[:, 0] - pose.x_m, points[:, 1] - pose.y_m
    return bool((CAR.distance_to(cos * dx + sin * dy, cos * dy - sin * dx) == 0).any())


def test_mirrored_walls_mirror_the_answers():
    geometry = SegmentGeometry(box(2, 1, 1, 0.5, 0.3), np.array([[3.0, -1.0, 0.2]]))
    mirrored = geometry.mirrored()
    np.testing.assert_allclose(mirrored.cast(0.0, -0.2, -FAN_RAD), geometry.cast(0.0, 0.2, FAN_RAD))
    assert mirrored.clearance(Pose(0.5, -0.2, -0.3), CAR) == pytest.approx(geometry.clearance(Pose(0.5, 0.2, 0.3), CAR))
