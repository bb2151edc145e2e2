"""Things that appear and walk."""

import math

import numpy as np
import pytest

from wallride.sim.world.obstacles import (
    Box,
    ConstantMotion,
    Obstacle,
    ObstacleWorld,
    StandingObstacle,
    person,
    pole,
    sudden_box,
)
from wallride.sim.world.pose import CAR, Pose
from wallride.sim.world.worlds import load_world

AHEAD = np.array([0.0])
WORLD = load_world("straight")


def seen_ahead(scene, pose):
    lidar = pose.ahead(0.27)
    return float(scene.cast(lidar.x_m, lidar.y_m, AHEAD + pose.yaw_rad)[0])


@pytest.mark.parametrize("ahead_m", [0.3, 0.6, 0.9])
def test_a_sudden_box_appears_at_its_distance_from_the_lidar_once_the_car_is_fast(ahead_m):
    scene = ObstacleWorld(WORLD, [sudden_box(ahead_m, min_speed_mps=2.0)])
    car = Pose(5.0, 0.0, 0.0)
    scene.update(0.0, car, 1.99)
    assert math.isinf(seen_ahead(scene, car))
    scene.update(0.1, car, 2.0)
    assert seen_ahead(scene, car) == pytest.approx(ahead_m)
    assert scene.clearance(car, CAR) == pytest.approx(ahead_m - 0.15)
    scene.update(0.2, car.ahead(0.1), 0.0)
    assert seen_ahead(scene, car.ahead(0.1)) == pytest.approx(ahead_m - 0.1)
    assert scene.collides(car.ahead(ahead_m - 0.14))
    assert scene.appeared == 1


def test_a_sudden_box_stands_square_to_a_turned_car():
    scene = ObstacleWorld(WORLD, [sudden_box(0.5, from_s=1.0)])
    car = Pose(5.0, -1.0, 0.4)
    scene.update(0.99, car, 1.0)
    assert seen_ahead(scene, car) > 2
    scene.update(1.0, car, 0.0)
    lidar = car.ahead(0.27)
    fan = np.array([-0.2, 0.0, 0.2])
    np.testing.assert_allclose(scene.cast(lidar.x_m, lidar.y_m, fan + 0.4) * np.cos(fan), 0.5)


def test_a_person_walks_between_two_times_only():
    walker = person(10.0, -2.0, ConstantMotion(0.0, 1.0, from_s=1.0, until_s=3.0))
    scene = ObstacleWorld(WORLD, [walker])
    down = np.array([-math.pi / 2])
    seen = []
    for now_s in (0.5, 1.0, 1.5, 3.0, 4.0):
        scene.update(now_s, Pose(0, 0, 0), 0.0)
        seen.append(float(scene.cast(10.0, 0.9, down)[0]))
    assert seen == pytest.approx([3.9, 2.7, 2.2, 0.7, 0.7])


def test_a_sudden_thing_moves_from_where_it_appeared():
    scene = ObstacleWorld(
        WORLD, [Obstacle(Box(0.2, 0.2), StandingObstacle(Pose(3.0, 0.0, 0.0), from_s=2.0), ConstantMotion(1.0, 0.0))]
    )
    scene.update(2.0, Pose(0, 0, 0), 0.0)
    scene.update(4.5, Pose(0, 0, 0), 0.0)
    assert seen_ahead(scene, Pose(0, 0, 0)) == pytest.approx(5.5 - 0.1 - 0.27)


def test_poles_hide_walls_but_do_not_count_as_walls():
    scene = ObstacleWorld(WORLD, [pole(0.0, 0.5, 0.05)])
    scene.update(0.0, Pose(0, 0, 0), 0.0)
    assert float(scene.cast(0.0, 0.0, np.array([math.pi / 2]))[0]) == pytest.approx(0.45)
    assert scene.clearance(Pose(0, 0, 0)) == pytest.approx(0.3)
    assert scene.world.wall_distance_m(Pose(0, 0, 0)) == pytest.approx(1.0)
    assert scene.obstacle_outline_m.shape == (16, 4)


def test_an_empty_scene_is_its_world():
    scene = ObstacleWorld(WORLD)
    fan = np.radians(np.linspace(-135, 135, 271))
    np.testing.assert_array_equal(scene.cast(0.0, 0.0, fan), WORLD.cast(0.0, 0.0, fan))
    assert scene.clearance(WORLD.start) == WORLD.clearance(WORLD.start)
