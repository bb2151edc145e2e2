"""The grid: walls, free and unknown cells."""

import numpy as np

from tests.sim.mapping.test_matching import KIND, frames_along
from wallride.runtime.control.perception.geometry import directions
from wallride.sim.mapping.raster import CELL_M, rasterized


def cell(raster, x_m, y_m):
    return int((y_m - raster.corner_m[1]) / CELL_M), int((x_m - raster.corner_m[0]) / CELL_M)


def test_walls_are_where_beams_end_and_cells_before_them_are_free():
    frames = frames_along("corridor", at_m=20.0) * 3
    poses = np.array([[20.0, 0.0, 0.0], [20.3, 0.0, 0.0]] * 3)
    raster = rasterized(frames, poses, KIND[1])
    along_m = np.arange(19.2, 21.5, 0.1)
    walls = [any(raster.wall[cell(raster, x_m, y_m)] for y_m in (0.97, 1.02)) for x_m in along_m]
    assert np.mean(walls) > 0.9
    assert np.mean([raster.free[cell(raster, x_m, 0.92)] for x_m in along_m]) > 0.9
    for x_m in along_m:
        assert not raster.wall[cell(raster, x_m, 0.92)]
        assert not raster.free[cell(raster, x_m, 1.3)] | raster.wall[cell(raster, x_m, 1.3)]


def test_of_people_that_walked_by_no_trace_remains():
    frames = frames_along("loop")
    with_person, without = frames
    points_m = with_person.points_m.copy()
    ahead = slice(KIND[2] // 2 - 20, KIND[2] // 2 + 21)
    points_m[:, ahead] = 1.52 * directions(*KIND)[:, ahead]
    person = type(with_person)(
        with_person.time_s, with_person.odometry, points_m,
        type(with_person.surface)(with_person.surface.points_m, with_person.surface.normals, np.zeros(KIND[2], bool)),
    )  # fmt: skip
    once = rasterized([person], np.zeros((1, 3)), KIND[1])
    assert once.wall[cell(once, 1.52, 0.02)]
    often = rasterized([person, *[without] * 9], np.zeros((10, 3)), KIND[1])
    assert not often.wall[cell(often, 1.52, 0.02)]
    assert often.free[cell(often, 1.52, 0.02)]


def test_what_the_car_has_driven_over_is_free_though_no_beam_tells_of_it():
    blind = frames_along("corridor", at_m=20.0)
    for frame in blind:
        frame.points_m[:, KIND[2] // 2 - 120 : KIND[2] // 2 + 121] = np.nan
        frame.surface.usable[KIND[2] // 2 - 120 : KIND[2] // 2 + 121] = False
    poses = np.array([[20.0, 0.0, 0.0], [20.3, 0.0, 0.0]])
    raster = rasterized(blind, poses, KIND[1])
    for x_m in np.arange(20.0, 20.35, 0.05):
        assert all(raster.free[cell(raster, x_m, y_m)] for y_m in (-0.12, 0.0, 0.12))
    assert not raster.free[cell(raster, 22.0, 0.0)]
