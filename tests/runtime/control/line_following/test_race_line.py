"""The nearest point of a closed line, and what the line is at a way along it."""

import cmath
import math

import numpy as np
import pytest

from tests.runtime.control.line_following.lines import circle, line_through


@pytest.mark.parametrize("turn", [0.0, 0.02, 1.0, 3.1, -0.01, -2.0])
@pytest.mark.parametrize("aside_m", [0.0, 0.4, -0.7])
def test_the_nearest_point_is_found_with_its_side(turn, aside_m):
    line = circle(radius_m=3.0)
    on = line.nearest((3.0 - aside_m) * cmath.exp(1j * turn))
    assert on.along_m == pytest.approx(3.0 * (turn % math.tau), abs=0.01)
    assert on.aside_m == pytest.approx(aside_m, abs=0.001)
    assert math.remainder(on.yaw_rad - turn - math.pi / 2, math.tau) == pytest.approx(0.0, abs=0.004)
    assert on.curvature_radpm == pytest.approx(1 / 3.0)


def test_a_part_that_passes_nearby_is_not_jumped_over_to():
    there, back = np.arange(0.0, 20.0, 0.1), np.arange(20.0, 0.0, -0.1)
    line = line_through(np.concatenate([there + 0j, back + 0.5j]), 0.0, 2.0)
    place = complex(8.0, 0.4)
    assert line.nearest(place).along_m > 20.0
    assert line.nearest(place, near_m=7.5).along_m == pytest.approx(8.0, abs=0.05)


def test_the_line_goes_on_behind_its_last_point():
    line = circle()
    assert line.place_at(line.length_m + 1.0) == pytest.approx(line.place_at(1.0))
    assert line.nearest(line.place_at(-0.05), near_m=0.3).along_m == pytest.approx(line.length_m - 0.05, abs=0.01)


def test_speeds_lie_between_those_of_the_points():
    line = line_through(np.array([0.0, 1.0, 1.0 + 1j, 1j]), 0.0, np.array([1.0, 3.0, 2.0, 2.0]))
    assert line.speed_at(0.5) == pytest.approx(2.0)
    assert line.speed_at(3.5) == pytest.approx(1.5)
