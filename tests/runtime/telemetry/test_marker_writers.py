"""The drawings show what is there: wall, strip, and the beam that stops the car."""

import math

import numpy as np
import pytest

from tests.runtime.observed import HandClock, make_observed, output_of, scan_at
from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import Source
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.telemetry import marker_writers
from wallride.sim.virtual.devices import ranges_between_walls

CAR = CarSettings()
OBSERVED = make_observed(HandClock())


def by_name(markers):
    return {marker.name: marker for marker in markers}


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_the_wall_is_drawn_where_it_is(side, sign):
    guidance = Guidance(Drive(1.0, 0.0), 0.8, 0.0, 0.0, "wall")
    wall = by_name(marker_writers.wall(guidance, side, None))["wall"]
    np.testing.assert_allclose(wall.points_m[1], sign * 0.8)
    assert wall.points_m[0, 0] < 0 < wall.points_m[0, 1]


def test_before_a_corner_the_line_stays_on_the_wall_it_was_fitted_to():
    before_a_corner = Guidance(Drive(1.0, 0.0), 0.6, -0.4, 0.0, "wall", line_m=1.0)
    np.testing.assert_allclose(by_name(marker_writers.wall(before_a_corner, "left", None))["wall"].points_m[1], 1.0)


def test_a_wall_that_leads_to_the_left_is_farther_left_ahead():
    guidance = Guidance(Drive(1.0, 0.0), 0.8, 0.0, 0.2, "wall")
    for side in ("left", "right"):
        behind, ahead = by_name(marker_writers.wall(guidance, side, None))["wall"].points_m.T
        assert ahead[1] > behind[1]


def test_without_a_wall_nothing_is_drawn_and_a_ball_only_where_there_is_one():
    nothing = Guidance(None, math.nan, math.nan, math.nan, "no wall")
    assert marker_writers.wall(nothing, "left", np.empty((2, 0))) == []
    ball = np.array([[1.0, 2.0], [0.1, 0.2]])
    assert by_name(marker_writers.wall(nothing, "left", ball))["ball"].points_m is ball


@pytest.mark.parametrize("steering_rad", [-0.3, 0.0, 1e-9, 0.2])
def test_the_way_is_the_circle_of_the_steering(steering_rad):
    x_m, y_m, yaw_rad = marker_writers.pose(steering_rad, 1.5, 0.33)
    steps = 15000
    x = y = yaw = 0.0
    for _ in range(steps):
        yaw += 1.5 / steps * math.tan(steering_rad) / 0.33
        x += 1.5 / steps * math.cos(yaw)
        y += 1.5 / steps * math.sin(yaw)
    assert (x_m, y_m, yaw_rad) == pytest.approx((x, y, yaw), abs=1e-3)


@pytest.mark.parametrize("steering_rad", [-0.3, 0.0, 0.2])
@pytest.mark.parametrize("travel_m", [-0.8, 1.5])
def test_the_edges_are_the_front_corners_on_their_way(steering_rad, travel_m):
    left, right = marker_writers.edges_m(CAR, steering_rad, travel_m)
    for place in (0, 7, -1):
        share = np.linspace(0, 1, marker_writers.STEPS)[place]
        x_m, y_m, yaw_rad = marker_writers.pose(steering_rad, share * travel_m, CAR.wheelbase_m)
        turned = np.array([[math.cos(yaw_rad), -math.sin(yaw_rad)], [math.sin(yaw_rad), math.cos(yaw_rad)]])
        for edge, aside_m in ((left, CAR.half_width_m), (right, -CAR.half_width_m)):
            np.testing.assert_allclose(edge[:, place], turned @ [CAR.front_m, aside_m] + [x_m, y_m], atol=1e-12)


def test_the_outline_is_closed_and_as_large_as_the_car():
    outline = marker_writers.outline_m(CAR)
    assert tuple(outline[:, 0]) == tuple(outline[:, -1]) == (CAR.front_m, CAR.half_width_m)
    assert np.ptp(outline, axis=1) == pytest.approx([CAR.front_m + CAR.rear_m, 2 * CAR.half_width_m])


def test_the_strip_ends_at_the_contact_and_the_beam_leads_to_it():
    ahead_m = 0.9
    view = ViewCache(CAR).see(scan_at(1.0, ranges_between_walls(1.0, 1.0, ahead_m=ahead_m)))
    way_m = ahead_m + CAR.lidar_x_m - CAR.front_m
    output = output_of(OBSERVED, speed_mps=0.0, winner=Source.SAFETY, reason="wall ahead", measure=way_m)
    drawn = by_name(marker_writers.footprint(output, CAR, view))
    # The steering of the output is 0.1 rad: the nose comes in at an angle.
    assert drawn["end"].points_m[0].max() == pytest.approx(ahead_m + CAR.lidar_x_m, abs=0.1)
    lidar, hit = drawn["the beam that stops"].points_m.T
    assert tuple(lidar) == (CAR.lidar_x_m, 0.0)
    assert hit[0] == pytest.approx(ahead_m + CAR.lidar_x_m, abs=0.01)


def test_a_car_that_nothing_holds_shows_a_second_of_its_way_and_no_beam():
    view = ViewCache(CAR).see(scan_at(1.0))
    drawn = by_name(marker_writers.footprint(output_of(OBSERVED, speed_mps=2.0), CAR, view))
    assert "the beam that stops" not in drawn
    left = drawn["left edge"].points_m
    travelled_m = np.hypot(*(left[:, 1:] - left[:, :-1])).sum()
    assert travelled_m == pytest.approx(2.0, rel=0.1)


def test_beams_that_are_left_out_are_shown():
    ranges_m = ranges_between_walls(1.0, 1.0)
    ranges_m[500:502] = 0.4  # too thin to be a thing
    view = ViewCache(CAR).see(scan_at(1.0, ranges_m))
    ignored = by_name(marker_writers.footprint(output_of(OBSERVED), CAR, view))["ignored"].points_m
    near = np.hypot(ignored[0] - CAR.lidar_x_m, ignored[1]) < 0.41
    assert np.count_nonzero(near) >= 2


def test_backing_is_drawn_backwards():
    drawn = by_name(marker_writers.footprint(output_of(OBSERVED, speed_mps=-0.5), CAR, None))
    assert drawn["end"].points_m[0].max() < CAR.front_m
