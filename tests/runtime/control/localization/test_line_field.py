"""The field of lines: distances from walls are exact, signed, and of the face that is seen."""

import numpy as np
import pytest

from tests.runtime.control.localization.rooms import CELL_M, Room, ring
from wallride.runtime.control.localization.line_field import NOWHERE_M, field_of_cells, line_field
from wallride.runtime.control.localization.place_search import mean_nearness
from wallride.runtime.control.localization.wall_points import MapCells, WallPoints, lines_through


def off_m(field, place, ahead):
    """Return the distance of a point from the wall that a beam meets there."""
    places, aheads = np.array([place], np.complex128), np.array([ahead], np.complex128)
    line = field.lines_at(places, aheads)
    return float((field.normals[line].conj() * places).real[0] - field.offsets_m[line][0])


@pytest.mark.parametrize("off", [-0.2, -0.03, 0.0, 0.01, 0.3])
def test_the_distance_from_a_straight_wall_is_exact_and_signed(off):
    field = field_of_cells(ring().cells)
    assert off_m(field, 5.0 - 1j + 1j * off, -1j) == pytest.approx(off, abs=1e-6)
    assert off_m(field, 11.0 + 2j - off, 1.0) == pytest.approx(off, abs=1e-6)


def test_a_thin_wall_is_seen_from_both_sides():
    room = Room([(0.0, 0.0, 6.0, 2.0), (0.0, 2.1, 6.0, 4.0)])
    field = field_of_cells(room.cells)
    for shift in (-0.04, 0.0, 0.07):
        assert off_m(field, 3.0 + 2.0j + 1j * shift, 1j) == pytest.approx(-shift, abs=1e-6), "from below"
        assert off_m(field, 3.0 + 2.1j + 1j * shift, -1j) == pytest.approx(shift, abs=1e-6), "from above"


@pytest.mark.parametrize("turn_deg", [10.0, 30.0, 44.0, 80.0])
def test_the_steps_of_a_slanting_wall_become_a_line(turn_deg):
    """The true line runs through the middles of the steps, half a cell off the drawn one at most."""
    turn = np.exp(1j * np.radians(turn_deg))
    row, column = np.mgrid[0:160, 0:160]
    across = ((column + 0.5 + 1j * (row + 0.5)) * CELL_M - (4 + 4j)) / turn
    wall = across.imag > 0
    field = field_of_cells(MapCells(wall, ~wall, CELL_M, 0j))
    errors = [off_m(field, 4 + 4j + turn * along, 1j * turn) for along in np.linspace(-1.5, 1.5, 40)]
    assert np.std(errors) < 0.012
    assert np.abs(np.mean(errors)) < 0.5 * CELL_M


def test_far_from_walls_and_off_the_map_there_is_no_line():
    field = field_of_cells(Room([(0.0, 0.0, 8.0, 8.0)]).cells)
    for place in (4 + 4j, 400.0 + 0j, -300.0 - 300j):
        assert off_m(field, place, 1.0) < -0.9 * NOWHERE_M


def test_noise_of_points_is_averaged_out():
    rng = np.random.default_rng(1)
    along = np.linspace(0.0, 5.0, 2000)
    places = along + 1j * rng.normal(0.0, 0.01, along.size)
    lines = lines_through(WallPoints(places, np.full(along.size, -1j)), CELL_M)
    inner = (lines.places_m.real > 0.3) & (lines.places_m.real < 4.7)
    assert np.abs(lines.places_m.imag[inner]).max() < 0.004
    assert np.degrees(np.abs(np.angle(lines.normals[inner] * 1j))).max() < 4.0


def test_a_map_without_walls_and_one_too_large_are_told():
    empty = np.zeros((40, 40), dtype=bool)
    with pytest.raises(ValueError, match="no wall that borders on free cells"):
        field_of_cells(MapCells(empty, ~empty, CELL_M, 0j))
    walls = np.zeros((300, 700), dtype=bool)
    walls[[0, 0, -1], [0, -1, 0]] = True
    with pytest.raises(ValueError, match="is too large"):
        field_of_cells(MapCells(walls, ~walls, 0.5, 0j))


@pytest.mark.parametrize("far_m", [1e5, 1e300])
def test_one_point_far_off_is_told_as_too_large_a_map_before_memory_is_asked_for(far_m):
    room = ring().cells
    points = WallPoints(np.array([0j, complex(far_m, far_m)]), np.array([1.0 + 0j, 1.0 + 0j]))
    with pytest.raises(ValueError, match="is too large"):
        line_field(points, room)


def test_the_nearness_of_a_cell_is_the_mean_at_the_ends_of_its_beams_and_a_corners_off_the_map():
    nearness = np.array([0.5, 0.0, 1.0, 0.25], np.float32)
    assert mean_nearness(nearness, np.array([0, 1, 3]), np.array([1, 2])).tolist() == [0.5, 0.625, 0.25]
    assert mean_nearness(nearness, np.array([0]), np.array([], np.int64)).tolist() == [0.0]
