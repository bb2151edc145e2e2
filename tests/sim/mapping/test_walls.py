"""The walls of a mapped lap: more exact than its cells."""

from pathlib import Path

import numpy as np

from benchmarks.racing.maps import MapDrive, recorded
from wallride.sim.mapping.closing import close_lap
from wallride.sim.mapping.raster import CELL_M, rasterized
from wallride.sim.mapping.walls import walls_of
from wallride.sim.world.worlds import load_world


def test_walls_are_found_to_a_centimetre_and_face_the_lidar():
    record, truth = recorded(MapDrive("loop", 3.0, 0.8, 3, gyro=True), Path())
    lap = close_lap(record)
    walls = walls_of(lap, rasterized(lap.frames, lap.poses, record.kind[1]))
    start = load_world("loop").start
    assert np.hypot(truth[0, 0] - start.x_m, truth[0, 1] - start.y_m) < 0.02
    there = walls.places_m * np.exp(1j * truth[0, 2]) + complex(*truth[0, :2])
    off_m = []
    for x0, y0, x1, y1 in load_world("loop").outline_m:
        along = (there - complex(x0, y0)) / complex(x1 - x0, y1 - y0)
        reach_m = np.hypot(x1 - x0, y1 - y0)
        off_m.append(np.where((along.real > -0.01) & (along.real < 1.01), np.abs(along.imag) * reach_m, np.inf))
    nearest_m = np.min(off_m, axis=0)
    assert np.percentile(nearest_m, 95) < 0.03
    assert np.median(nearest_m) < 0.4 * CELL_M / 2
    assert np.abs(np.abs(walls.normals) - 1.0).max() < 1e-9
