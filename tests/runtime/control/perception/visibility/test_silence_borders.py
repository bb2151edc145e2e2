"""Borders of silence, beam by beam: what stays in the world is told from what goes along with the car."""

import cmath
import math

import numpy as np
import pytest

from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.visibility.silence_borders import Border, Borders

LIDAR_X_M = 0.27
BEAM_RAD = math.radians(0.25)
CORNER = complex(3.5, 1.0)


def followed(bearing_of, scans=30, step_m=0.02, turn_rad=0.0, loses=()):
    """Return the borders after so many scans, and how far the car had gone when they were first known to stay."""
    borders, known_m = Borders(LIDAR_X_M), None
    for scan in range(scans):
        pose = OdometryState(step_m * scan, 0.0, turn_rad * scan)
        bearing_rad, range_m = bearing_of(pose)
        seen = Border(1, BEAM_RAD * round(bearing_rad / BEAM_RAD), range_m)
        borders.update([] if scan in loses else [seen], pose, BEAM_RAD)
        if known_m is None and borders.stays(1, bearing_rad):
            known_m = pose.x_m
    return known_m


def corner_from(pose):
    off = (CORNER - complex(pose.x_m, pose.y_m)) * cmath.rect(1.0, -pose.yaw_rad) - LIDAR_X_M
    return cmath.phase(off), abs(off)


def along_a_wall(bearing_rad):
    return lambda _: (bearing_rad, 1.0 / math.sin(bearing_rad))


def test_the_end_of_a_wall_is_known_to_stay_after_a_quarter_of_a_metre():
    known_m = followed(corner_from)
    assert known_m is not None
    assert 0.25 <= known_m <= 0.3


@pytest.mark.parametrize("turn_rad", [0.0, 0.02, -0.02])
@pytest.mark.parametrize("bearing_deg", [10, 17, 30, 60, 90])
def test_a_border_that_goes_along_never_is(bearing_deg, turn_rad):
    assert followed(along_a_wall(math.radians(bearing_deg)), 60, turn_rad=turn_rad) is None


def test_a_border_that_scatters_never_is():
    random = np.random.default_rng(5)

    def scatters(pose):
        bearing_rad, range_m = corner_from(pose)
        return bearing_rad + math.radians(random.uniform(-2.0, 2.0)), range_m

    assert followed(scatters) is None


def test_a_car_that_stands_learns_nothing():
    assert followed(corner_from, 60, step_m=0.0) is None


def test_a_border_that_was_out_of_sight_is_followed_anew():
    assert followed(corner_from, 20, loses=(12,)) is None


def test_a_border_that_is_far_off_and_hardly_turns_is_not_judged():
    assert followed(lambda _: (math.radians(5), 11.5), 20) is None
