"""Maps of real places load, each with its quirks, and start the car somewhere sensible."""

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wallride.runtime.map_files import read_settings
from wallride.sim.world import compiled
from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.map_file import load_map, read_occupancy
from wallride.sim.world.pose import Pose

MAPS = Path(__file__).resolve().parents[3] / ".." / "shared" / "data" / "maps"
NAMES = "berlin", "hangar", "itrl", "levine", "skirk", "track_porto"


def shared_map(name):
    path = MAPS / f"{name}.yaml"
    if not path.is_file():
        pytest.skip(f"the shared maps are not here ({path.name})")
    return path


def write_map(folder, rows, text="resolution: 0.5\norigin: [0, 0, 0]\n", dtype=np.uint8, name="m.png"):
    Image.fromarray(np.array(rows, dtype=dtype)).save(folder / name)
    path = folder / "m.yaml"
    path.write_text(f"image: {name}\n{text}")
    return path


@pytest.mark.parametrize(("name", "side"), list(zip(NAMES, 3 * ("left", "right"), strict=True)))
def test_every_shared_map_loads_with_a_start_beside_a_wall(name, side):
    world = load_map(shared_map(name), side=side)
    assert world.name == name
    assert world.side == side
    assert world.room_m == (0.8 if name == "levine" else 1.0)
    assert world.wall_distance_m(world.start) == pytest.approx(world.room_m, abs=0.1)
    assert world.clearance(world.start) > 0.4
    ahead = world.start.yaw_rad + np.radians([-4.0, 0.0, 4.0])
    assert world.cast(world.start.x_m, world.start.y_m, ahead).min() > 4.0
    metre_on = world.start.ahead(1.0)
    assert world.wall_distance_m(metre_on) == pytest.approx(world.room_m, abs=0.2), "not parallel to the wall"
    fan = world.cast(world.start.x_m, world.start.y_m, world.start.yaw_rad + np.radians(np.linspace(-135, 135, 1081)))
    assert np.isfinite(fan).all(), "a map is closed"
    assert fan.min() > 0.5


@pytest.mark.parametrize("name", ["track_porto"])
def test_the_same_map_gives_the_same_start_with_and_without_a_compiler(name):
    path = shared_map(name)
    first = load_map(path)
    assert load_map(path).start == first.start
    with compiled.numpy_only():
        plain = load_map(path)
    assert (plain.start, plain.room_m) == (first.start, first.room_m)


@pytest.mark.parametrize(("name", "cell_m", "corner"), [
    ("stata_basement", 0.0504, (-26.9, -16.5)),
    ("hangar", 0.05, (-14.471603, -27.434684)),
    ("levine", 0.05, (-51.224998, -51.224998)),
])  # fmt: skip
def test_resolutions_and_origins_as_written(name, cell_m, corner):
    settings = read_settings(shared_map(name))
    assert settings.cell_m == pytest.approx(cell_m)
    assert settings.origin[:2] == pytest.approx(corner)


def test_levines_grey_outside_is_not_drivable_although_its_threshold_says_free():
    world = load_map(shared_map("levine"))
    x_min, y_min, x_max, y_max = world.bounds_m
    assert x_max - x_min < 40
    assert y_max - y_min < 30


def test_the_image_lies_with_row_0_at_the_top_and_the_origin_at_its_lower_left(tmp_path):
    picture = np.zeros((6, 8))
    picture[1, 2:5] = 254  # second row from the top
    path = write_map(tmp_path, picture, "resolution: 0.5\norigin: [10.0, 20.0, 0.0]\n")
    world = load_map(path)
    assert isinstance(world.geometry, GridGeometry)
    assert world.geometry.is_free(11.25, 22.25)
    assert not world.geometry.is_free(11.25, 20.75)
    assert world.bounds_m == pytest.approx((11.0, 22.0, 12.5, 22.5))


def test_a_turned_origin_and_block_style(tmp_path):
    path = write_map(tmp_path, np.full((4, 4), 254), "origin:\n- 1.0\n- 2.0\n- 1.5707963267948966\nresolution: 1.0")
    assert load_map(path).bounds_m == pytest.approx((-3.0, 2.0, 1.0, 6.0))


@pytest.mark.parametrize(("picture", "dtype", "negate", "expected"), [
    ([[0, 255]], np.uint8, 0, [1, 0]),
    ([[0, 255]], np.uint8, 1, [0, 1]),
    ([[205, 254]], np.uint8, 0, [50 / 255, 1 / 255]),
    ([[0, 65535]], np.uint16, 0, [1, 0]),
    ([[[0, 0, 0], [255, 255, 255]]], np.uint8, 0, [1, 0]),
    ([[[0, 0, 0, 255], [255, 255, 255, 255]]], np.uint8, 0, [1, 0]),
    ([[0, 40, 100, 255]], np.uint8, "1\nmode: raw", [0, 0.4, 1, 1]),
])  # fmt: skip
def test_shades_become_occupancy(tmp_path, picture, dtype, negate, expected):
    path = write_map(tmp_path, picture, f"resolution: 1.0\norigin: [0, 0, 0]\nnegate: {negate}\n", dtype)
    np.testing.assert_allclose(read_occupancy(read_settings(path))[0], expected, atol=1e-9)


def test_only_the_largest_connected_region_is_drivable(tmp_path):
    picture = np.zeros((20, 40))
    picture[2:18, 2:20] = 254
    picture[2:18, 22:30] = 254  # a room without a door
    picture[5, 10] = 205  # unknown, in the middle of the floor
    geometry = load_map(write_map(tmp_path, picture)).geometry
    assert isinstance(geometry, GridGeometry)
    assert geometry.is_free(5.25, 5.25)
    assert not geometry.is_free(13.0, 5.25)
    assert not geometry.is_free(5.25, (19 - 5 + 0.5) * 0.5)


@pytest.mark.parametrize("text", [
    "resolution: 0.05\n", "origin: [0, 0, 0]\n", "resolution: 0\norigin: [0, 0, 0]\n",
    "resolution: x\norigin: [0, 0, 0]\n",
    "resolution: 0.05\norigin: [0, 0]\n", "resolution: .nan\norigin: [0, 0, 0]\n", "resolution: [\n", "\t- :",
    "resolution: 1e9\norigin: [0, 0, 0]\n", "resolution: 1e-9\norigin: [0, 0, 0]\n",
    "resolution: 0.05\norigin: [0, 0, 0]\noccupied_thresh: 0.1\nfree_thresh: 0.9\n",
])  # fmt: skip
def test_nonsense_is_refused_by_name(tmp_path, text):
    path = write_map(tmp_path, [[254]], text)
    with pytest.raises(ValueError, match=r"m\.yaml") as caught:
        load_map(path)
    assert "unpack" not in str(caught.value)


def test_missing_and_broken_images_are_named(tmp_path):
    path = write_map(tmp_path, [[254]])
    (tmp_path / "m.png").unlink()
    with pytest.raises(FileNotFoundError, match=r"m\.png"):
        load_map(path)
    (tmp_path / "m.png").write_bytes(b"not a picture")
    with pytest.raises(ValueError, match=r"m\.png"):
        load_map(path)
    with pytest.raises(ValueError, match="negate"):
        load_map(write_map(tmp_path, [[0, 0]]))


def test_a_drawn_corridor_starts_along_it(tmp_path):
    picture = np.zeros((60, 400))
    picture[10:50, 5:395] = 254
    world = load_map(write_map(tmp_path, picture, "resolution: 0.05\norigin: [0, 0, 0]\n"))
    assert abs(math.sin(world.start.yaw_rad)) < 0.02
    assert world.wall_distance_m(world.start) == pytest.approx(1.0, abs=0.1)
    assert world.collides(Pose(0.0, 1.5, 0.0))


def drawing(folder, margin):
    """A corridor ring of 0.1 m cells, as a drawing on white paper of that margin in cells."""
    building = np.zeros((80, 120), np.uint8)
    building[4:-4, 4:-4] = 254
    building[24:-24, 24:-24] = 0
    paper = np.full((80 + 2 * margin, 120 + 2 * margin), 254, np.uint8)
    paper[margin : margin + 80, margin : margin + 120] = building
    return write_map(folder, paper, "resolution: 0.1\norigin: [0, 0, 0]\n")


@pytest.mark.parametrize("margin", [1, 60, 200])
def test_a_start_is_in_the_building_and_not_on_the_paper_around_the_drawing(tmp_path, margin):
    world = load_map(drawing(tmp_path, margin))
    left_m, low_m = 0.1 * margin, 0.1 * margin
    assert left_m < world.start.x_m < left_m + 12.0
    assert low_m < world.start.y_m < low_m + 8.0
    x_min, y_min, x_max, y_max = world.bounds_m
    assert (x_max - x_min, y_max - y_min) == pytest.approx((11.2, 7.2), abs=0.21), "the paper is no part of the world"


def test_where_there_is_nothing_but_paper_it_is_the_world(tmp_path):
    rows = np.full((80, 80), 254, np.uint8)
    rows[30:50, 30:50] = 0
    world = load_map(write_map(tmp_path, rows, "resolution: 0.1\norigin: [0, 0, 0]\n"))
    assert world.clearance(world.start) > 0.3


def test_a_plain_pgm_with_comments_and_odd_yaml_loads(tmp_path):
    rows = "\n".join(" ".join("0" if i in {0, 39} or k in {0, 39} else "99" for k in range(40)) for i in range(40))
    (tmp_path / "m.pgm").write_text(f"P2\n# by a converter\n40 40\n# and more\n99\n{rows}\n")
    (tmp_path / "m.yaml").write_text(
        "image:\tm.pgm\t# beside\nresolution: '0.1'\norigin: [1, 2, 0]\nmode: trinary\nnegate: no\n"
    )
    world = load_map(tmp_path / "m.yaml")
    assert world.bounds_m == pytest.approx((1.1, 2.1, 4.9, 5.9))


@pytest.mark.parametrize("named", ["/home/bob/maps/m.png", "maps/m.png", r"C:\\maps\\m.png", "file of old/m.png"])
def test_the_image_of_another_computers_path_is_taken_beside_the_file_and_said(tmp_path, named, caplog):
    path = write_map(tmp_path, np.full((40, 40), 254))
    path.write_text(path.read_text().replace("image: m.png", f"image: {named}"))
    assert load_map(path)
    assert f"there is no image {named}: the one beside it is taken, m.png" in caplog.text
    (tmp_path / "m.png").unlink()
    with pytest.raises(FileNotFoundError, match=r"m\.png is missing; `image` in the \.yaml file names it"):
        load_map(path)


def test_a_small_image_of_a_huge_map_is_refused_before_it_is_unpacked(tmp_path):
    Image.new("1", (9000, 9000)).save(tmp_path / "m.png")
    path = tmp_path / "m.yaml"
    path.write_text("image: m.png\nresolution: 0.05\norigin: [0, 0, 0]\n")
    with pytest.raises(ValueError, match=r"9000 x 9000 cells are more than 32 million"):
        load_map(path)


def test_a_map_file_that_only_nests_is_refused_with_its_line(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text("image: " + "[" * 4000)
    with pytest.raises(ValueError, match=r"m\.yaml, line 1, image: nests deeper"):
        load_map(path)
