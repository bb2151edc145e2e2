"""Compiled equivalent of the numpy casts (`casting.c`), a part of the extension module; optional.

numpy answers, more slowly, where that is not built, with WALLRIDE_COMPILED=0, and where a cast was edited in Python
since its C was sealed. A geometry chooses when it is made, so that the benchmark compares both in one process.
"""

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np

from wallride.drivers.accelerated import SWITCH, Accelerated, UnfitError
from wallride.sim.world.free_rectangles import FreeRectangles
from wallride.sim.world.pose import Floats, Pose

Scene = tuple[Any, ...]
"""The first arguments of the C of `cast_cells` or `cast_walls`."""


def cells(rectangles: FreeRectangles, origin: Pose, cell_m: float) -> Scene:
    """Return a grid for `cast_cells`."""
    cos, sin = math.cos(origin.yaw_rad), math.sin(origin.yaw_rad)
    grid = origin.x_m, origin.y_m, cos, sin, origin.yaw_rad, cell_m, rectangles.rows, rectangles.columns
    return rectangles.leaps.ravel(), grid


def cast(
    function: Callable[..., None], scene: Scene, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats
) -> Floats:
    """Return the distances of the C of `cast_cells` or `cast_walls`, shape (n,); see World.cast."""
    bearing = np.ascontiguousarray(bearing_rad, dtype=np.float64)
    ranges = np.empty(bearing.shape)
    if isinstance(x_m, np.ndarray) or isinstance(y_m, np.ndarray):
        x_m = np.ascontiguousarray(np.broadcast_to(x_m, bearing.shape), dtype=np.float64)
        y_m = np.ascontiguousarray(np.broadcast_to(y_m, bearing.shape), dtype=np.float64)
    function(*scene, x_m, y_m, bearing, ranges)
    return ranges


def by_c(python: Callable[..., Floats]) -> Callable[..., None] | None:
    """Return the C of `cast_cells` or `cast_walls`; None where numpy has to answer."""
    return None if os.environ.get(SWITCH) == "0" else _fitting(python)


@cache
def _fitting(python: Callable[..., Floats]) -> Callable[..., None] | None:
    try:
        return Accelerated(python).compiled()
    except UnfitError:
        return None


@contextmanager
def numpy_only() -> Iterator[None]:
    """Use the numpy casts for all objects created in this context, to compare the two."""
    before = os.environ.get(SWITCH)
    os.environ[SWITCH] = "0"
    try:
        yield
    finally:
        os.environ.pop(SWITCH)
        if before is not None:
            os.environ[SWITCH] = before
