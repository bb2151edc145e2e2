"""The way round a course from which a line is optimized: closed, evenly spaced, smooth. Frame: the map's."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from wallride.runtime.host.text_file import TextFileError, read_text
from wallride.sim.world.ball_contour import ring_along
from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.place import START_DISTANCE_M, World
from wallride.sim.world.pose import Floats, Side

SPACING_M: Final = 0.2
SMOOTH_M: Final = 0.4
MIN_LENGTH_M: Final = 5.86
"""The car's tightest circle, R = 0.933 m."""
BALLS_M: Final = tuple(round(START_DISTANCE_M - 0.1 * step, 1) for step in range(7))
PATH_SUFFIX: Final = ".path.csv"
"""Ending of the file beside a map, in place of .yaml, with the path of the lap that the map was made of."""
MAX_PATH_MB: Final = 20
JOINS_WITHIN_M: Final = 1.0
"""Maximum gap between the last point of a path and its first."""


class NoRingError(ValueError):
    """The course does not close on itself, or cannot be told from the map; the text says what to give instead."""


def ring_of(world: World) -> Floats:
    """Return the way round a world, shape (n, 2), in the direction of the followed wall.

    A course has its own centre line. On a map it is the path of the largest ball that rolls along the followed wall
    past the start and returns.

    Raises: NoRingError.
    """
    if world.lap is not None:
        return even(world.lap.points_m)
    if isinstance(world.geometry, GridGeometry):
        return even(_along_the_wall(world.geometry, world))
    raise NoRingError(f"{world.name} does not close on itself: there is no lap to race")


def ring_of_path(path_m: Floats, *, what: str) -> Floats:
    """Return the way round of a path that was driven or drawn, shape (n, 2), as a ring; it may overlap its beginning.

    Raises: NoRingError where its end does not come back to its beginning.
    """
    if len(path_m) < 3 or not np.isfinite(path_m).all():
        raise NoRingError(f"{what}: a path needs three points and finite numbers")
    along_m = np.concatenate([[0.0], np.cumsum(lengths(np.diff(path_m, axis=0)))])
    back = np.flatnonzero((along_m > MIN_LENGTH_M) & (lengths(path_m - path_m[0]) < JOINS_WITHIN_M))
    first_back = back[: 1 + int(np.argmax(np.append(np.diff(back) > 1, True)))] if len(back) else back
    if not len(first_back):
        gap_m = float(lengths(path_m[-1:] - path_m[0])[0])
        raise NoRingError(f"{what}: the path does not return to its beginning (it ends {gap_m:.1f} m from it)")
    end = first_back[int(np.argmin(lengths(path_m[first_back] - path_m[0])))]
    return even(path_m[:end])


def even(points_m: Floats, spacing_m: float = SPACING_M, smooth_m: float = SMOOTH_M) -> Floats:
    """Return a ring through points, shape (n, 2), evenly spaced and smoothed by a Gaussian of `smooth_m`."""
    from scipy import ndimage

    length_m = ring_length_m(points_m)
    if length_m < MIN_LENGTH_M:
        raise NoRingError(f"a lap of {length_m:.1f} m is shorter than the car's tightest circle ({MIN_LENGTH_M} m)")
    spaced = resampled(points_m, max(12, round(length_m / spacing_m)))
    if smooth_m <= 0.0:
        return spaced
    smooth: Floats = ndimage.gaussian_filter1d(spaced, smooth_m / (length_m / len(spaced)), axis=0, mode="wrap")
    return resampled(smooth, len(spaced))


def resampled(points_m: Floats, count: int) -> Floats:
    """Return `count` points at equal distances along a ring, the first one kept."""
    closed = np.vstack([points_m, points_m[:1]])
    along_m = np.concatenate([[0.0], np.cumsum(lengths(np.diff(closed, axis=0)))])
    keep = np.append(True, np.diff(along_m) > 0.0)
    at_m = along_m[-1] * np.arange(count) / count
    return np.column_stack([np.interp(at_m, along_m[keep], part[keep]) for part in closed.T])


def ring_length_m(points_m: Floats) -> float:
    """Return the length of a closed polyline."""
    return float(lengths(points_m - np.roll(points_m, 1, axis=0)).sum())


def driven_path(map_file: Path) -> Path | None:
    """Return the file beside a map with the path of the lap that it was made of, None without one."""
    beside = map_file.with_name(f"{map_file.stem}{PATH_SUFFIX}")
    return beside if beside.is_file() else None


def read_path(path: Path) -> Floats:
    """Return x, y of each row of a text file, shape (n, 2): columns by comma, semicolon or blank, `#` for comments.

    The columns x_m and y_m where the last comment before the numbers names them, else the first two: files of the gym's
    centre lines (x, y, widths) and of wallride's and TUM's lines (s, x, y, ...) are read alike.

    Raises: NoRingError names the line; OSError.
    """
    names: Sequence[str] = ()
    rows: list[tuple[float, float]] = []
    for number, text in enumerate(_text_of(path).splitlines(), 1):
        cells = text.strip().lstrip("#").replace(";", " ").replace(",", " ").split()
        if not cells:
            continue
        if text.lstrip().startswith("#"):
            names = cells if not rows else names
            continue
        first, second = (names.index(name) if name in names else at for at, name in enumerate(("x_m", "y_m")))
        try:
            rows.append((float(cells[first]), float(cells[second])))
        except (IndexError, ValueError):
            raise NoRingError(f"{path}, line {number}: no x and y in {text.strip()[:60]!r}") from None
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _text_of(path: Path) -> str:
    try:
        return read_text(path, MAX_PATH_MB, errors="replace")
    except TextFileError as error:
        raise NoRingError(f"{path} is not the file of a path: {error}") from None


def _along_the_wall(geometry: GridGeometry, world: World) -> Floats:
    from scipy import ndimage

    away_m = ndimage.distance_transform_edt(~geometry.solid) * geometry.cell_m
    origin, start = geometry.origin, world.start
    cos, sin = math.cos(origin.yaw_rad), math.sin(origin.yaw_rad)
    dx, dy = start.x_m - origin.x_m, start.y_m - origin.y_m
    at_m = np.array([cos * dx + sin * dy, cos * dy - sin * dx])
    side: Side = world.side
    for ball_m in BALLS_M:
        ring_m = ring_along(away_m, geometry.cell_m, ball_m, side, at_m)
        if ring_m is not None:
            turned = np.column_stack([cos * ring_m[:, 0] - sin * ring_m[:, 1], sin * ring_m[:, 0] + cos * ring_m[:, 1]])
            placed: Floats = turned + np.array([origin.x_m, origin.y_m])
            return placed
    raise NoRingError(
        f"{world.name}: the wall on the {world.side} does not lead back to the start; give the way round with --path, "
        "or take the other side"
    )


def lengths(vectors: Floats) -> Floats:
    """Return the lengths (n,) of vectors (n, 2)."""
    return np.hypot(vectors[:, 0], vectors[:, 1])
