"""Cars in one world see and hit each other's outlines, and stand at places from which each can drive."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from wallride.runtime.settings.tree import Settings, load_settings
from wallride.sim.car.vehicle import Vehicle, VehicleSettings
from wallride.sim.live.traffic import TrafficWorld, outline_m, starts
from wallride.sim.scenario.simulated_car import find_config
from wallride.sim.world.obstacles import pole
from wallride.sim.world.pose import CAR, Pose
from wallride.sim.world.worlds import load_world


@pytest.fixture
def settings() -> Settings:
    return load_settings(find_config())


def vehicle_at(x_m, y_m, yaw_rad=0.0):
    return Vehicle(VehicleSettings(), Pose(x_m, y_m, yaw_rad))


def test_the_outline_is_the_cars_rectangle_where_the_car_is():
    segments = outline_m(Pose(1.0, 2.0, math.pi / 2))
    x_m, y_m = segments[:, [0, 2]], segments[:, [1, 3]]
    assert (x_m.min(), x_m.max()) == pytest.approx((1.0 - CAR.half_width_m, 1.0 + CAR.half_width_m))
    assert (y_m.min(), y_m.max()) == pytest.approx((2.0 + CAR.rear_m, 2.0 + CAR.front_m))
    assert np.allclose(segments[:, 2:], np.roll(segments[:, :2], -1, axis=0)), "closed"


def test_a_car_is_seen_where_it_is_now_and_hidden_by_nothing_else():
    world, other = load_world("straight"), vehicle_at(3.0, 0.0)
    traffic = TrafficWorld(world, [pole(5.0, 0.0)], [other])
    traffic.update(0.0, world.start, 0.0)
    ahead = np.array([0.0])
    assert traffic.cast(0.0, 0.0, ahead)[0] == pytest.approx(3.0 + CAR.rear_m)
    other.place(Pose(9.0, 0.0, 0.0))
    assert traffic.cast(0.0, 0.0, ahead)[0] == pytest.approx(5.0 - 0.02), "the pole, now that the car is behind it"


def test_cars_that_touch_are_in_contact_both():
    world = load_world("straight")
    first, second = vehicle_at(0.0, 0.0), vehicle_at(CAR.front_m - CAR.rear_m + 0.05, 0.0)
    seen_by_first, seen_by_second = TrafficWorld(world, [], [second]), TrafficWorld(world, [], [first])
    assert seen_by_first.clearance(first.pose) == pytest.approx(0.05)
    assert not seen_by_first.collides(first.pose)
    second.place(Pose(CAR.front_m - CAR.rear_m - 0.01, 0.0, 0.0))
    assert seen_by_first.collides(first.pose)
    assert seen_by_second.collides(second.pose)


@pytest.mark.parametrize(("name", "count", "gap_m"), [("loop", 4, 30.3 / 4), ("straight", 3, 3.0)])
def test_every_start_is_free_at_the_wanted_distance_and_apart(settings, name, count, gap_m):
    world = load_world(name)
    poses = starts(world, count, settings)
    assert poses[0] == world.start
    assert len(poses) == count
    for here, there in pairwise(poses):
        apart_m = math.hypot(there.x_m - here.x_m, there.y_m - here.y_m)
        assert apart_m <= 1.3 * gap_m + 0.1
        assert apart_m > 0.5 * gap_m, "round a corner the straight distance is shorter than the way"
    assert all(world.wall_distance_m(pose) == pytest.approx(1.0, abs=0.1) for pose in poses), "none in a corner"


def test_a_world_in_which_a_car_alone_does_not_come_that_far_is_refused(settings):
    touching = replace(load_world("straight"), start=Pose(0.0, 0.9, 0.0))
    with pytest.raises(ValueError, match=r"no place for 3 cars: a car alone ends after 0 m of 6 m"):
        starts(touching, 3, settings)
