"""The walls of a mapped lap as points with normals, more exact than the cells of its grid."""

import numpy as np
from scipy.ndimage import binary_dilation

from wallride.runtime.control.localization.wall_points import WallPoints, lines_through
from wallride.sim.mapping.closing import ClosedLap
from wallride.sim.mapping.raster import CELL_M, Raster


def walls_of(lap: ClosedLap, raster: Raster) -> WallPoints:
    """Return a point for each cell and side of the grid's walls, on the line through what all keyframes saw."""
    places, normals = [], []
    for frame, pose in zip(lap.frames, lap.poses, strict=True):
        surface = frame.surface
        points = (surface.points_m[0] + 1j * surface.points_m[1])[surface.usable]
        faces = (surface.normals[0] + 1j * surface.normals[1])[surface.usable]
        faces = np.where((faces.conj() * points).real > 0.0, -faces, faces)
        turn = np.exp(1j * pose[2])
        places.append(points * turn + complex(pose[0], pose[1]))
        normals.append(faces * turn)
    points, faces = np.concatenate(places), np.concatenate(normals)
    there = (points - complex(*raster.corner_m)) / CELL_M
    row, column = there.imag.astype(np.int64), there.real.astype(np.int64)
    wide = binary_dilation(raster.wall, np.ones((3, 3), np.bool_))  # a wall on a cell's edge has points in both
    of_wall = wide[row, column]
    return lines_through(WallPoints(points[of_wall], faces[of_wall]), CELL_M)
