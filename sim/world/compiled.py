"""Compiled equivalent of the numpy casts (`casting.c`), built once with the machine's own C compiler; optional.

It needs no installation: without a compiler, or with WALLRIDE_COMPILED=0, `library` is None and
numpy is used, more slowly. The built file is kept in the user's cache, named by a hash of all its dependencies.
"""

import ctypes
import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import numpy as np

from runtime.kernel import SWITCH
from runtime.kernel.build import built
from sim.world.free_rectangles import FreeRectangles
from sim.world.pose import Floats, Pose

SOURCE = Path(__file__).with_name("casting.c")
_BYTES = ctypes.c_char * 1


class Beams(ctypes.Structure):
    """`struct beams` of casting.c."""

    _fields_ = (
        ("x0", ctypes.c_double),
        ("y0", ctypes.c_double),
        ("x", ctypes.c_void_p),
        ("y", ctypes.c_void_p),
        ("bearing", ctypes.c_void_p),
        ("ranges", ctypes.c_void_p),
        ("count", ctypes.c_int64),
    )


class Cells(ctypes.Structure):
    """`struct cells` of casting.c."""

    _fields_ = (
        *((name, ctypes.c_double) for name in ("x", "y", "cos", "sin", "yaw", "cell_m", "rows", "columns")),
        ("leaps", ctypes.c_void_p),
    )


class Walls(ctypes.Structure):
    """`struct walls` of casting.c."""

    _fields_ = (
        ("straight", ctypes.c_void_p),
        ("circles", ctypes.c_void_p),
        ("straight_count", ctypes.c_int64),
        ("circle_count", ctypes.c_int64),
        ("end_slack_m", ctypes.c_double),
        ("edge_on", ctypes.c_double),
    )


def cells(rectangles: FreeRectangles, origin: Pose, cell_m: float) -> Cells:
    """Return a grid for `cast_cells`; the caller keeps the rectangles alive as long as it is used."""
    cos, sin = math.cos(origin.yaw_rad), math.sin(origin.yaw_rad)
    rows, columns = rectangles.rows, rectangles.columns
    return Cells(origin.x_m, origin.y_m, cos, sin, origin.yaw_rad, cell_m, rows, columns, rectangles.leaps.ctypes.data)


def walls(straight: Floats, circles: Floats, *, end_slack_m: float, edge_on: float) -> Walls:
    """Return walls for `cast_walls`; contiguous (n, 5) and (m, 3), kept alive by the caller as long as it is used."""
    return Walls(straight.ctypes.data, circles.ctypes.data, len(straight), len(circles), end_slack_m, edge_on)


def cast(
    function: Callable[..., None], scene: Cells | Walls, x_m: float | Floats, y_m: float | Floats, bearing_rad: Floats
) -> Floats:
    """Return the distances of the library's `cast_cells` or `cast_walls`, shape (n,); see World.cast.

    The arrays that `scene` points to belong to the caller.
    """
    bearing = np.ascontiguousarray(bearing_rad, dtype=np.float64)
    ranges = np.empty(bearing.shape)
    beams = Beams(bearing=_address(bearing), ranges=_address(ranges), count=bearing.size)
    if isinstance(x_m, np.ndarray) or isinstance(y_m, np.ndarray):
        x = np.ascontiguousarray(np.broadcast_to(x_m, bearing.shape), dtype=np.float64)
        y = np.ascontiguousarray(np.broadcast_to(y_m, bearing.shape), dtype=np.float64)
        beams.x, beams.y = _address(x), _address(y)
    else:
        beams.x0, beams.y0 = x_m, y_m
    function(ctypes.byref(scene), ctypes.byref(beams))
    return ranges


def _address(array: Floats) -> int:
    """Return the address of an array's data; `array.ctypes.data` takes four times as long, which is measurable."""
    if array.flags.writeable and array.size:
        return ctypes.addressof(_BYTES.from_buffer(array.data))
    return array.ctypes.data


def library() -> ctypes.CDLL | None:
    """Return the compiled casts, built on the first call on this machine; None if they are not available.

    WALLRIDE_COMPILED=0 in the environment means numpy only.
    """
    return None if os.environ.get(SWITCH) == "0" else _library()


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


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL | None:
    path = built("casting", {SOURCE.name: SOURCE.read_text()})
    return None if path is None else _loaded(path)


def _loaded(path: Path) -> ctypes.CDLL | None:
    try:
        library = ctypes.CDLL(str(path))
        for kind in ("cast_cells", "cast_walls"):
            function = getattr(library, kind)
            function.restype, function.argtypes = None, (ctypes.c_void_p, ctypes.c_void_p)
    except (OSError, AttributeError):
        return None
    return library
