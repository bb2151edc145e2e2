"""The files of a map as the car reads them: with numpy alone, and with one sentence for each mistake."""

import numpy as np
import pytest

from wallride.runtime.control.localization.wall_points import WallPoints
from wallride.runtime.map_files import MapError, read_map, read_pgm, read_settings, read_walls, walls_text
from wallride.sim.world.map_file import read_occupancy

YAML = (
    "image: m.pgm\nresolution: 0.05\norigin: [-1.0, -2.0, 0.0]\nnegate: {}\nfree_thresh: 0.196\noccupied_thresh: 0.65\n"
)


def write(folder, shades, *, negate=0, header="P5\n# made by hand\n{} {}\n255\n"):
    rows, columns = shades.shape
    (folder / "m.pgm").write_bytes(header.format(columns, rows).encode() + shades.astype(np.uint8).tobytes())
    (folder / "m.yaml").write_text(YAML.format(negate))
    return folder / "m.yaml"


def box():
    """A free room in unknown ground, its upper wall with the grey edge of a scaled drawing."""
    shades = np.full((60, 80), 205)
    shades[10:50, 10:70] = 0
    shades[12:48, 12:68] = 254
    shades[12, 12:68] = 150
    return shades


@pytest.mark.parametrize("negate", [0, 1])
def test_a_pgm_is_read_as_pillow_reads_it(tmp_path, negate):
    path = write(tmp_path, np.random.default_rng(3).integers(0, 256, (7, 9)), negate=negate)
    settings = read_settings(path)
    np.testing.assert_allclose(read_pgm(settings), read_occupancy(settings), atol=1e-12)


def test_a_map_of_another_program_has_walls_at_its_cells_and_no_start(tmp_path):
    known = read_map(write(tmp_path, box()))
    assert known.start is None
    assert known.scale == 1.0
    field = known.field
    left = field.near[field.cells_at(np.array([-0.38 - 0.9j]))]
    assert field.offsets_m[left] == pytest.approx(-0.4), "the left wall, seen from the right"


def test_a_map_is_shown_as_its_file_has_it(tmp_path):
    grid = read_map(write(tmp_path, box())).grid
    assert (grid.cell_m, grid.corner_m) == (0.05, -1.0 - 2.0j)
    upper_left = grid.values[60 - 14 : 60 - 9, 9:14]  # image rows run down
    assert upper_left.tolist() == [
        [-1, 100, 100, 0, 0], [-1, 100, 100, -1, -1], [-1, 100, 100, 100, 100], [-1, 100, 100, 100, 100], [-1] * 5,
    ]  # fmt: skip


def round_the_box(shift=0.0):
    """Return the walls of `box` as points, moved by a shift."""
    xs, ys = -0.4 + np.arange(0.0, 2.81, 0.05), -1.4 + np.arange(0.0, 1.81, 0.05)
    sides = ((xs - 1.4j, 1j), (xs + 0.4j, -1j), (-0.4 + 1j * ys, 1.0), (2.4 + 1j * ys, -1.0))
    places = np.concatenate([side for side, _ in sides]) + shift
    return WallPoints(places, np.concatenate([np.full(side.size, normal) for side, normal in sides]).astype(complex))


def test_the_walls_beside_a_map_are_taken_with_scale_and_start(tmp_path):
    path = write(tmp_path, box())
    (tmp_path / "m.walls.csv").write_text(walls_text(round_the_box(0.007j), 0.9712, "map by hand"))
    known = read_map(path)
    assert known.start == (0.0, 0.0, 0.0)
    assert known.scale == 0.9712
    lower = known.field.near[known.field.cells_at(np.array([1.0 - 1.2j]))]
    assert known.field.offsets_m[lower] == pytest.approx(-1.393, abs=1e-6)


@pytest.mark.parametrize(
    "walls",
    [
        round_the_box(1.0), round_the_box(0.5 + 0.4j), round_the_box(-3.0),
        WallPoints(round_the_box().places_m[:60], round_the_box().normals[:60]),
    ],
)  # fmt: skip
def test_the_walls_of_another_lap_or_half_of_them_are_refused(tmp_path, walls):
    path = write(tmp_path, box())
    (tmp_path / "m.walls.csv").write_text(walls_text(round_the_box(0.05), 1.0, "by hand"))
    read_map(path)
    (tmp_path / "m.walls.csv").write_text(walls_text(walls, 1.0, "by hand"))
    with pytest.raises(MapError, match=r"m\.walls\.csv: these are not the walls of the image: \d+% .* Copy all files"):
        read_map(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no points"),
        ("# scale: 0.97\n1; 2; 3\n", "line 2: not x_m; y_m; nx; ny"),
        ("1; 2; nan; 1\n", "line 1: not x_m"),
        ("1; 2; 0; 0\n", "line 1: not x_m"),
        ("# scale: 9\n1; 2; 1; 0\n", "a scale of 9"),
        ("# points: 2\n1; 2; 1; 0\n", "it was cut, 1 of 2 points are left"),
    ],
)
def test_walls_that_cannot_be_are_told_with_their_line(tmp_path, text, said):
    path = tmp_path / "m.walls.csv"
    path.write_text(text)
    with pytest.raises(MapError, match=said):
        read_walls(path)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda folder: folder / "none.yaml", "no map file .*none.yaml"),
        (lambda folder: write(folder, box(), header="P6\n{} {}\n255\n"), "not a PGM image of 8 bits"),
        (lambda folder: write(folder, box(), header="P5\n9{} {}\n255\n"), "cells and holds"),
        (lambda folder: write(folder, np.full((30, 30), 254)), "m.yaml: the map has no wall"),
    ],
)
def test_a_map_that_cannot_be_read_is_told_in_one_sentence(tmp_path, make, said):
    with pytest.raises(MapError, match=said) as caught:
        read_map(make(tmp_path))
    assert "\n" not in str(caught.value)
