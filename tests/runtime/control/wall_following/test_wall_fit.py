"""The wall line: exact on clean walls, unmoved by wild beams, the same every time, and silent without a wall."""

import math

import numpy as np
import pytest

from wallride.runtime.control.perception.geometry import bearings_rad
from wallride.runtime.control.wall_following.wall_fit import MIN_INLIERS, LineFinder, WallLine, draw

BEARING_RAD = bearings_rad(-math.radians(135), math.radians(0.25), 1081)[::-1]
FINDER = LineFinder(BEARING_RAD)
LIDAR_X_M = 0.27


def ranges_to(distance_m, heading_rad):
    """Ranges to an endless wall on the left, `distance_m` from the rear axle; NaN where no beam meets it."""
    from_lidar_m = distance_m + LIDAR_X_M * math.sin(heading_rad)
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges_m = from_lidar_m / np.sin(BEARING_RAD - heading_rad)
    ranges_m[(ranges_m <= 0) | (ranges_m > 30)] = np.nan
    return ranges_m


def between(from_deg, to_deg):
    return np.abs(np.degrees(BEARING_RAD) - (from_deg + to_deg) / 2) < (to_deg - from_deg) / 2


def find(ranges_m, usable=None, expected=None, finder=FINDER):
    x_m = LIDAR_X_M + np.cos(BEARING_RAD) * ranges_m
    y_m = np.sin(BEARING_RAD) * ranges_m
    return finder.find(x_m, y_m, ranges_m, np.isfinite(ranges_m) if usable is None else usable, expected)


@pytest.mark.parametrize("distance_m", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("heading_rad", [-0.5, 0.0, 0.3])
def test_a_clean_wall_is_found_where_it_is(distance_m, heading_rad):
    line = find(ranges_to(distance_m, heading_rad))
    assert line.distance_m == pytest.approx(distance_m, abs=1e-6)
    assert line.heading_rad == pytest.approx(heading_rad, abs=1e-6)


@pytest.mark.parametrize("step_deg", [0.125, 0.352, 0.5, 1.0, 1.5])
def test_any_sensor_finds_a_wall_whatever_its_beams_are_apart(step_deg):
    step_rad = math.radians(step_deg)
    bearing_rad = bearings_rad(-math.radians(135), step_rad, int(270 / step_deg) + 1)[::-1]
    with np.errstate(divide="ignore"):
        ranges_m = (1.0 + LIDAR_X_M * math.sin(0.2)) / np.sin(bearing_rad - 0.2)
    ranges_m += np.random.default_rng(5).normal(0.0, 0.02, bearing_rad.size)
    x_m, y_m = LIDAR_X_M + np.cos(bearing_rad) * ranges_m, np.sin(bearing_rad) * ranges_m
    line = LineFinder(bearing_rad).find(x_m, y_m, ranges_m, (ranges_m > 0.0) & (ranges_m < 30.0))
    assert line is not None
    assert line.distance_m == pytest.approx(1.0, abs=0.01)
    assert line.heading_rad == pytest.approx(0.2, abs=0.01)


def test_noise_and_a_fifth_of_wild_beams_move_it_by_millimetres():
    rng = np.random.default_rng(7)
    errors = []
    for _ in range(100):
        ranges_m = ranges_to(1.0, 0.1) + rng.normal(0.0, 0.03, BEARING_RAD.size)
        wild = rng.random(BEARING_RAD.size) < 0.2
        ranges_m[wild] = rng.uniform(0.02, 10.0, np.count_nonzero(wild))
        line = find(ranges_m)
        errors.append((abs(line.distance_m - 1.0), abs(line.heading_rad - 0.1)))
    mean_m, mean_rad = np.mean(errors, axis=0)
    assert mean_m < 0.005
    assert mean_rad < math.radians(0.3)


def test_the_same_scan_gives_the_same_line():
    ranges_m = ranges_to(1.2, -0.2) + np.random.default_rng(3).normal(0.0, 0.03, BEARING_RAD.size)
    assert find(ranges_m) == find(ranges_m.copy())
    usable = np.isfinite(ranges_m)
    assert np.array_equal(LineFinder(BEARING_RAD).front, FINDER.front)
    again = LineFinder(BEARING_RAD).find(
        LIDAR_X_M + np.cos(BEARING_RAD) * ranges_m, np.sin(BEARING_RAD) * ranges_m, ranges_m, usable
    )
    assert again == find(ranges_m)


def test_the_nearer_of_two_parallel_walls_wins():
    near_m, far_m = ranges_to(1.0, 0.0), ranges_to(2.0, 0.0)
    gone = between(55, 100)  # a wide door in the near one: the far one has the greater vote, but for its distance
    assert find(np.where(gone, far_m, near_m)).distance_m == pytest.approx(1.0, abs=0.01)


def test_the_crowded_beams_of_a_near_thing_do_not_outvote_the_wall():
    near_m, wall_m = ranges_to(0.4, 0.0), ranges_to(1.0, 0.0)
    assert find(np.where(between(66, 126), near_m, wall_m)).distance_m == pytest.approx(1.0, abs=0.01)


def test_a_wall_that_is_rather_across_than_beside_is_not_taken():
    assert find(ranges_to(1.0, math.radians(-55))) is not None
    assert find(ranges_to(1.0, math.radians(-70))) is None


def test_beams_that_are_not_to_be_believed_do_not_count():
    ranges_m = ranges_to(1.0, 0.0)
    near = between(36, 126)
    ranges_m[near] = 0.4 / np.sin(BEARING_RAD[near])
    assert find(ranges_m).distance_m == pytest.approx(0.4, abs=0.01)
    assert find(ranges_m, ~near & np.isfinite(ranges_m)).distance_m == pytest.approx(1.0, abs=0.01)


def test_no_wall_is_said_instead_of_guessed():
    nothing = np.full(BEARING_RAD.size, np.nan)
    assert find(nothing) is None
    few = nothing.copy()
    few[FINDER.beams[20 : 20 + MIN_INLIERS - 1]] = 1.0
    assert find(few) is None
    few[:] = np.nan
    ends = sorted((int(FINDER.front[0]), int(FINDER.rear[0])))  # seven beams on a line that is sure to be tried
    on_line = FINDER.beams[np.linspace(ends[0], ends[1], MIN_INLIERS - 1).astype(int)]
    few[FINDER.beams[[0, 70, 140]]] = 4.5, 3.9, 3.3
    few[on_line] = 1.0 / np.sin(BEARING_RAD[on_line])
    assert find(few) is None
    cloud = np.random.default_rng(1).uniform(0.3, 30.0, BEARING_RAD.size)
    cloud[np.abs(BEARING_RAD) > math.radians(30)] = 29.0
    assert find(cloud) is None


def test_a_wall_across_the_way_is_not_the_wall_beside():
    ranges_m = 2.0 / np.cos(BEARING_RAD)
    ranges_m[(ranges_m <= 0) | (ranges_m > 5)] = np.nan
    assert find(ranges_m) is None


def test_a_line_seen_from_another_place():
    moved = find(ranges_to(1.0, 0.2)).seen_from(0.3, 0.1, 0.05)
    normal_way_m = math.cos(0.2) * 0.1 - math.sin(0.2) * 0.3
    assert moved.distance_m == pytest.approx(1.0 - normal_way_m, abs=1e-6)
    assert moved.heading_rad == pytest.approx(0.15, abs=1e-6)


def test_a_lidar_that_does_not_look_aside_finds_no_wall():
    ahead_rad = np.radians(np.linspace(15, -15, 61))
    ranges_m = np.full(61, 1.0)
    line = LineFinder(ahead_rad).find(np.cos(ahead_rad), np.sin(ahead_rad), ranges_m, np.ones(61, bool))
    assert line is None


class NoVote(LineFinder):
    """Finds what it expects, or nothing."""

    def __init__(self, bearing_rad):
        super().__init__(bearing_rad)
        self.front = self.rear  # pairs of a point with itself show no direction


@pytest.mark.parametrize(("noise_m", "off"), [(0.02, 1e-3), (0.03, 3e-3)])
def test_a_line_that_is_where_it_was_expected_needs_no_vote_and_is_the_same(noise_m, off):
    rng = np.random.default_rng(4)
    blind = NoVote(BEARING_RAD)
    for _ in range(50):
        ranges_m = ranges_to(1.0, 0.1) + rng.normal(0.0, noise_m, BEARING_RAD.size)
        found = find(ranges_m, expected=WallLine(1.01, 0.095, 140), finder=blind)
        voted = find(ranges_m)
        assert found.distance_m == pytest.approx(voted.distance_m, abs=off)
        assert found.heading_rad == pytest.approx(voted.heading_rad, abs=off)


def test_an_expected_line_that_is_not_nearly_everything_has_to_stand_for_the_vote():
    near_m, far_m = ranges_to(1.0, 0.0), ranges_to(2.0, 0.0)
    ranges_m = np.where(between(55, 70), far_m, near_m)
    expected = WallLine(2.0, 0.0, 140)
    assert find(ranges_m, expected=expected) == find(ranges_m)
    assert find(ranges_m, expected=expected, finder=NoVote(BEARING_RAD)) is None
    assert find(ranges_m, expected=WallLine(1.0, 0.0, 140), finder=NoVote(BEARING_RAD)) is None


@pytest.mark.parametrize(("least", "most"), [(1, 1), (1, 2), (1, 5), (6, 44), (18, 132), (3, 1000)])
@pytest.mark.parametrize("count", [1, 64, 333])
def test_the_numbers_drawn_are_those_of_numpy(least, most, count):
    whole, shares = draw(least, most, count)
    numpy = np.random.default_rng(20)
    assert np.array_equal(whole, numpy.integers(least, most + 1, count))
    assert np.array_equal(shares, numpy.random(count))
