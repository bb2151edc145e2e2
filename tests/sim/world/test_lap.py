"""Progress along a closed centre line."""

import pytest

from wallride.sim.world.lap import Lap, LapCounter

SQUARE = Lap([(0, 0), (10, 0), (10, 10), (0, 10)])


@pytest.mark.parametrize(("x", "y", "expected_m"), [(0, 0, 0), (3, 1, 3), (11, 4, 14), (4, 9, 26), (-1, 2, 38)])
def test_progress_is_that_of_the_nearest_point(x, y, expected_m):
    assert SQUARE.progress_m(x, y) == pytest.approx(expected_m)


def test_laps_add_up_over_the_start_line_and_count_down_backwards():
    counter = LapCounter(SQUARE)
    corners = [(5, 0), (10, 5), (5, 10), (0, 5)]
    for x, y in corners * 2 + [(5, 0)]:
        counter.update(x, y)
    assert counter.laps == pytest.approx(2.0)
    for x, y in reversed(corners):
        counter.update(x, y)
    assert counter.laps == pytest.approx(1.0)


def test_waiting_on_the_start_line_is_no_lap():
    counter = LapCounter(SQUARE)
    for wobble in (0.1, -0.1) * 50:
        counter.update(wobble, 0)
    assert abs(counter.laps) < 0.01


@pytest.mark.parametrize("points", [[(0, 0), (1, 0)], [(0, 0), (1, 0), (1, 0)], [(0, 0), (1, 0), (1, 1), (0, 0)]])
def test_a_line_that_is_no_ring_is_refused(points):
    with pytest.raises(ValueError, match="three points"):
        Lap(points)
