"""Compiled equivalent of the numpy casts (`casting.c`), a part of the extension module; optional.

Where that is not built, or with WALLRIDE_COMPILED=0, `library` is None and numpy is used, more slowly.
"""

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np

from drivers.accelerated import SWITCH, UnfitError, extension
from sim.world.free_rectangles import FreeRectangles
from sim.world.pose import Floats, Pose

Scene = tuple[Any, ...]
"""The first arguments of `cast_cells` or `cast_walls`."""


def cells(rectangles: FreeRectangles, origin: Pose, cell_m: float) -> Scene:
    """Return a grid for `cast_cells`."""
    cos, sin = math.cos(origin.yaw_rad), math.sin(origin.yaw_rad)
    grid = origin.x_m, origin.y_m, cos, sin, origin.yaw_rad, cell_m, rectangles.rows, rectangles.columns
    return rectangles.leaps.ravel(), grid


def walls(straight: Floats, circles: Floats, *, end_slack_m: float, edge_on: float) -> Scene:
    """Return walls for `cast_walls`; (n, 5) and (m, 3)."""
    return straight.ravel(), np.asarray(circles, np.float64).ravel(), (end_slack_m, edge_on)


def cast(
    function: Callable[..., None], scene: Scene, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats
) -> Floats:
    """Return the distances of the library's `cast_cells` or `cast_walls`, shape (n,); see World.cast."""
    bearing = np.ascontiguousarray(bearing_rad, dtype=np.float64)
    ranges = np.empty(bearing.shape)
    if isinstance(x_m, np.ndarray) or isinstance(y_m, np.ndarray):
        x_m = np.ascontiguousarray(np.broadcast_to(x_m, bearing.shape), dtype=np.float64)
        y_m = np.ascontiguousarray(np.broadcast_to(y_m, bearing.shape), dtype=np.float64)
    function(*scene, x_m, y_m, bearing, ranges)
    return ranges


def library() -> ModuleType | None:
    """Return the module with the compiled casts; None if it is not available.

    WALLRIDE_COMPILED=0 in the environment means numpy only.
    """
    if os.environ.get(SWITCH) == "0":
        return None
    try:
        found = extension()
    except UnfitError:
        return None
    return found if hasattr(found, "cast_cells") else None


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
