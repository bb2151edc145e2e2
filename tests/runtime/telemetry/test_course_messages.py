"""The messages of map and line: of the file's cells and points, and never longer than a link takes as a whole."""

import math
from typing import Any

import numpy as np
import pytest

from tests.runtime.ros.samples import ros_store
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.line_following.race_line import CourseLine
from wallride.runtime.control.localization.wall_points import MapGrid
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.telemetry.course_messages import coarsened, timed, written
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import MAX_SAMPLE_BYTES

STORE = ros_store()
STAMP_NS = 1_790_000_000_000_000_000


def circle(count, radius_m=5.0, speed_mps=2.0):
    """Return a line round the origin, to the left."""
    turn_rad = np.arange(count) * math.tau / count
    places = radius_m * np.exp(1j * turn_rad)
    step_m = abs(places[1] - places[0])
    ones = np.ones(count)
    return CourseLine(
        places, step_m * np.arange(count), turn_rad + math.pi / 2, ones / radius_m, speed_mps * ones, step_m * count
    )


def shown(line=None, grid=None):
    """Return a course of which only what is shown is there."""
    nothing: Any = None
    return RaceCourse("lab", nothing, nothing, line, grid)


def decoded(topic, **course):
    told = written(shown(**course), STAMP_NS)
    assert len(told[topic]) <= MAX_SAMPLE_BYTES
    return STORE.deserialize_cdr(told[topic], TYPES[topic])


def test_the_unknown_rim_of_a_map_is_left_out_and_the_rest_lies_where_it_was():
    values = np.full((40, 60), -1, dtype=np.int8)
    values[10:20, 30:50] = 0
    values[10, 30:50] = 100
    grid = decoded(topics.MAP, grid=MapGrid(values, 0.05, 1.0 - 2.0j, 1j))
    assert (grid.header.frame_id, grid.info.width, grid.info.height) == ("map", 20, 10)
    assert grid.info.resolution == pytest.approx(0.05)
    corner = grid.info.origin.position
    assert (corner.x, corner.y) == pytest.approx((1.0 - 10 * 0.05, -2.0 + 30 * 0.05)), "rows run along -x here"
    assert 2 * math.atan2(grid.info.origin.orientation.z, grid.info.origin.orientation.w) == pytest.approx(math.pi / 2)
    np.testing.assert_array_equal(np.asarray(grid.data).reshape(10, 20), values[10:20, 30:50])


def test_cells_of_a_large_map_grow_until_it_fits_and_no_wall_is_lost():
    values = np.zeros((2000, 2000), dtype=np.int8)
    values[[0, -1], :], values[:, [0, -1]] = 100, 100
    values[1003, 1501] = 100
    values[500:700, 500:700] = -1
    grid = decoded(topics.MAP, grid=MapGrid(values, 0.05, 0j))
    times = round(grid.info.resolution / 0.05)
    assert grid.info.width * times >= 2000
    assert (grid.info.width - 1) * times < 2000
    cells = np.asarray(grid.data).reshape(grid.info.height, grid.info.width)
    assert cells[1003 // times, 1501 // times] == 100
    assert cells[600 // times, 600 // times] == -1
    assert (cells[:, 0] == 100).all()
    assert (cells[2:80, 2:70] == 0).all()


def test_a_map_of_which_nothing_is_known_has_one_cell():
    assert coarsened(MapGrid(np.full((3, 4), -1, dtype=np.int8), 0.05, 0j)).values.tolist() == [[-1]]


def test_the_stamps_of_a_line_are_its_own_times_and_the_lap_ends_where_it_began():
    line = circle(100)
    path = decoded(topics.LINE, line=line)
    stamps_s = [one.header.stamp.sec + one.header.stamp.nanosec / 1e9 - STAMP_NS / 1e9 for one in path.poses]
    assert len(path.poses) == 101
    assert stamps_s[1] == pytest.approx(line.length_m / 100 / 2.0, abs=1e-6)
    assert stamps_s[-1] == pytest.approx(line.length_m / 2.0, abs=1e-6), "the theoretical time of a lap"
    first, last = path.poses[0].pose.position, path.poses[-1].pose.position
    assert (first.x, first.y) == (last.x, last.y) == (5.0, 0.0)
    assert {one.header.frame_id for one in path.poses} == {"map"}


@pytest.mark.parametrize("count", [1000, 4000, 100_000])
def test_a_long_line_has_fewer_points_and_the_same_time(count):
    line = circle(count)
    assert timed(line)[-1][0] == pytest.approx(line.length_m / 2.0)
    decoded(topics.LINE, line=line)


def test_a_line_that_stands_somewhere_has_a_time_nevertheless():
    line = circle(100, speed_mps=0.0)
    assert math.isfinite(timed(line)[-1][0])
