"""Selection of the points of the followed wall, and of the room beside it.

Everything is for a wall on the left: `WallSide` brings a scan into that form. Points come in the order in which the eye
goes from the rear of the wall side across the front to the other side.
"""

import cmath
import math
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.drivers.api import Scan
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats, Places, bearings_rad
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.wall_following.wall_fit import LineFinder, WallLine, fit_wall_line

Booleans = npt.NDArray[np.bool_]
Beams = npt.NDArray[np.intp]
"""Indices of beams, in the order of WallSide."""

CAP_M = 3.5
"""Maximum range of the followed wall: without it the front wall joins left and right wall in a dead end."""
GAP_DIAMETERS = 1.8
MAX_GAP_M = 1.6
"""Maximum gap within one wall: the ball does not fit through gaps narrower than its diameter; beyond wider ones is
another wall."""
CROSSING_M = 0.6
"""Minimum jump from the followed side to a wall that runs ahead on the other side that is a corridor, not a gap."""
CROSSING_POINTS = 6
SIDE_FROM_RAD = math.radians(11)
SIDE_TO_RAD = math.radians(132)
"""Bearing up to which the nearest return selects the piece of the followed wall."""
LANE_FROM_RAD = math.radians(60)
"""Where the way on is narrow, from here on: ahead of a car that turns into a lane the other wall is the nearer one."""
MIN_POINTS = 5
SMOOTHED_POINTS = 5
THINNED_TO_M = 0.08
MIN_RANGE_M = 1e-3
"""Minimum range of a point from the rear axle: the ball's path divides by ranges."""
GLASS_RANGE_M = 6.0
GLASS_GAP_M = 4.5
GLASS_ON_LINE_M = 0.08
GLASS_FIRST_BEAMS = 12
GLASS_SILENT_SHARE = 0.8
ROOM_EVERY_BEAM = 2
ROOM_FROM_RAD = math.radians(5)
ROOM_BESIDE_M = 0.5
ROOM_REACH_M = 0.8
"""A point beside the rear axle is farther from the lidar, which is ahead of it, by no more than this."""
ROOM_NEAREST_SHARE = 0.1
ROOM_MIN_GAIN_M = 0.03
"""Minimum lack of room below 2 D that narrows D; otherwise noise would narrow a corridor of exactly 2 D."""


@value()
class WallSide:
    """One kind of lidar, seen so that the followed wall is on the left. bearing_rad: falls from the rear left.

    beside: beams of the wall side. in_lane: those that see it in a narrow lane. opposite_from: the first of the beams
    beside that may see what is on the other side of the car.
    """

    order: slice
    sign: float
    bearing_rad: Floats
    beside: slice
    in_lane: slice
    opposite_from: int
    lines: LineFinder


@lru_cache(maxsize=8)
def wall_side(angle_min_rad: float, angle_step_rad: float, beams: int, side: Literal["left", "right"]) -> WallSide:
    """Return the order and the cached trigonometry for a lidar and a side."""
    sign = 1.0 if side == "left" else -1.0
    order = slice(None, None, -1 if sign * angle_step_rad > 0 else 1)
    bearing_rad = sign * bearings_rad(angle_min_rad, angle_step_rad, beams)[order]
    beside, in_lane = (_between(bearing_rad, from_rad, SIDE_TO_RAD) for from_rad in (SIDE_FROM_RAD, LANE_FROM_RAD))
    ahead = int(np.searchsorted(-bearing_rad, -ROOM_FROM_RAD))
    return WallSide(order, sign, bearing_rad, beside, in_lane, ahead - ahead % ROOM_EVERY_BEAM, LineFinder(bearing_rad))


def _between(bearing_rad: Floats, from_rad: float, to_rad: float) -> slice:
    """Return the row of beams between two bearings."""
    index = np.flatnonzero((bearing_rad >= from_rad) & (bearing_rad <= to_rad))
    return slice(int(index[0]), int(index[-1]) + 1) if index.size else slice(0, 0)


@value(eq=False)
class SideView:
    """A view with the followed wall on the left; arrays (beams,) in the order of WallSide."""

    side: WallSide
    x_m: Floats
    y_m: Floats
    range_m: Floats
    solid: Booleans
    no_echo: Booleans


def side_view(view: View, side: Literal["left", "right"]) -> SideView:
    """Return the view in mirror and order so that the followed wall is on the left."""
    scan: Scan = view.scan
    way = wall_side(scan.angle_min_rad, scan.angle_step_rad, scan.ranges_m.shape[0], side)
    order = way.order
    y_m = view.y_m[order] if way.sign > 0 else -view.y_m[order]
    return SideView(way, view.x_m[order], y_m, view.ranges_m[order], view.solid[order], view.no_echo[order])


@value(eq=False)
class FollowedWall:
    """The followed wall in one scan.

    beams: those that see it, in order. line: of its points beside the car, None where they are no line.
    room_m: D' = min(D, half of the free width between the line and the opposite side). glass_to: the beam at the far
    end of a pane of glass that begins at its front end, -1 where there is none.
    """

    beams: Beams
    line: WallLine | None
    room_m: float
    glass_to: int


def choose_wall(
    seen: SideView, ball_m: float, expected: WallLine | None, desired_m: float, *, into_lane: bool = False
) -> FollowedWall | None:
    """Return the followed wall, or None when no piece of wall is beside the car.

    Cut where neighbours are farther apart than the ball is thick, and where the eye jumps to the other wall of a narrow
    corridor: the car passes between them. The piece that holds the nearest return beside the car is mine (not the first
    one: after a U turn another wall is behind the car).

    ball_m: radius of the ball. expected: where its line should be by the last scan. desired_m: D. into_lane: whether
    the way on is narrower than D would need.
    """
    beside = seen.side.in_lane if into_lane else seen.side.beside
    found = find_followed_wall(seen, beside, min(GAP_DIAMETERS * ball_m, MAX_GAP_M), expected, desired_m)
    if found is None:
        return None
    beams, line, room_m, glass_to = found
    return FollowedWall(beams, WallLine(*line) if line is not None else None, room_m, glass_to)


def _flat_wall(
    seen: SideView, beside: slice, gap_m: float, expected: WallLine | None, desired_m: float
) -> tuple[Any, ...]:
    side, lines = seen.side, seen.side.lines
    expected_m, expected_rad = (math.nan, 0.0) if expected is None else (expected.distance_m, expected.heading_rad)
    return (
        seen.x_m, seen.y_m, seen.range_m, seen.solid, seen.no_echo, beside.start, beside.stop, side.opposite_from,
        gap_m, lines.beams, lines.rear, lines.front, expected_m, expected_rad, desired_m,
    )  # fmt: skip


@accelerated(flat=_flat_wall)
def find_followed_wall(
    seen: SideView, beside: slice, gap_m: float, expected: WallLine | None, desired_m: float
) -> tuple[Beams, tuple[float, float, int] | None, float, int] | None:
    """Return beams, line, room_m and glass_to of FollowedWall, None without a piece of wall.

    beside: beams of the wall side. gap_m: where its neighbours are farther apart, a wall ends. expected, desired_m: see
    `choose_wall`.
    """
    wall = wall_piece(seen, beside, gap_m)
    if wall is None:
        return None
    found = fit_wall_line(seen.x_m, seen.y_m, seen.range_m, seen.solid, seen.side.lines, expected)
    if found is None:
        return wall, None, desired_m, -1
    line, near = WallLine(*found), seen.solid & (seen.range_m < GLASS_RANGE_M)
    glass_to = pane_to(seen.x_m, seen.y_m, near, seen.no_echo, int(wall[-1]), line)
    return wall, found, room_for(seen, line, desired_m), glass_to


def wall_piece(seen: SideView, beside: slice, gap_m: float) -> Beams | None:
    """Return the beams of the followed wall among those of a view, cut where gaps are wider than gap_m."""
    range_m = seen.range_m
    index = np.flatnonzero(seen.solid & (range_m < CAP_M))
    first = int(np.searchsorted(index, beside.start))
    last = int(np.searchsorted(index, beside.stop))
    if index.size < MIN_POINTS or last <= first:
        return None
    x_m, y_m = seen.x_m[index], seen.y_m[index]
    dx, dy = x_m[1:] - x_m[:-1], y_m[1:] - y_m[:-1]
    dx *= dx
    dy *= dy
    dx += dy
    jumps = np.flatnonzero(dx > min(gap_m, CROSSING_M) ** 2)  # few, if any
    nearest = first + int(range_m[index[first:last]].argmin())
    start, end = 0, index.size
    for jump, piece_end in pairwise([*jumps.tolist(), index.size - 1]):
        piece = slice(jump + 1, piece_end + 1)
        crosses = y_m[jump] > 0.0 and dx[jump] > CROSSING_M * CROSSING_M and _is_opposite(x_m[piece], y_m[piece])
        if dx[jump] > gap_m * gap_m or crosses:
            if jump >= nearest:
                end = jump + 1
                break
            start = jump + 1
    return index[start:end] if end - start >= MIN_POINTS else None


def _is_opposite(x_m: Floats, y_m: Floats) -> bool:
    """Return whether this piece is a corridor's other wall, from its far end on: a front wall crosses the heading.

    It begins on the other side of the heading. Where the car is not turned along its corridor, the far end may be on
    my side of the heading; then the piece comes back from there to the other side of the car.
    """
    last = min(CROSSING_POINTS, x_m.size) - 1
    comes_back = y_m[-1] <= 0.0 and x_m[-1] < x_m[0]
    return bool(abs(x_m[last] - x_m[0]) > abs(y_m[last] - y_m[0]) and (y_m[0] <= 0.0 or comes_back))


def outline(x_m: Floats, y_m: Floats, wall: Beams) -> Places:
    """Return the wall's points smoothed by a 5-point mean and thinned to one per 8 cm, x + iy, shape (m,)."""
    count, half = wall.size, SMOOTHED_POINTS // 2
    places = np.empty(count, np.complex128)
    places.real, places.imag = x_m[wall], y_m[wall]
    if count > SMOOTHED_POINTS:
        total = places.cumsum()
        places[half + 1 : count - half] = (total[SMOOTHED_POINTS:] - total[:-SMOOTHED_POINTS]) * (1 / SMOOTHED_POINTS)
        places[half] = total[SMOOTHED_POINTS - 1] / SMOOTHED_POINTS
    way_m = np.abs(places[1:] - places[:-1]).cumsum()
    way_m *= 1 / THINNED_TO_M
    cell = way_m.astype(np.intp)
    keep = np.empty(count, np.bool_)
    np.not_equal(cell[1:], cell[:-1], out=keep[1:-1])
    keep[0] = keep[-1] = True  # the first point and the last one stay
    kept: Places = places[keep]
    return kept


def around(places_m: Places, x_m: float, y_m: float, yaw_rad: float) -> tuple[Floats, Floats, float]:
    """Return range_m and bearing_rad of places x + iy, (n,) each, seen from (x_m, y_m) at that heading; the nearest."""
    seen = (places_m - complex(x_m, y_m)) * cmath.rect(1.0, -yaw_rad)
    range_m = np.maximum(np.abs(seen), MIN_RANGE_M)
    return range_m, np.arctan2(seen.imag, seen.real), float(range_m.min(initial=math.inf))


def pane_to(x_m: Floats, y_m: Floats, near: Booleans, no_echo: Booleans, end: int, line: WallLine) -> int:
    """Return the beam at the far end of a pane of glass beyond the beam `end`, the last of the wall; -1: there is none.

    A pane returns only the beams near its normal. If points lie on the wall's line beyond the gap, and most beams
    between have no echo, the wall goes on; beams that do return show a real opening, which stays open.
    near: beams with something that is not farther away than glass is looked for.
    """
    beyond = end + 1
    if np.count_nonzero(no_echo[beyond : beyond + GLASS_FIRST_BEAMS]) < GLASS_FIRST_BEAMS // 2:
        return -1  # the usual case, at once
    on_line = near[beyond:] & (np.abs(line.offsets_m(x_m[beyond:], y_m[beyond:])) < GLASS_ON_LINE_M)
    if np.count_nonzero(on_line) < MIN_POINTS:
        return -1
    far = beyond + int(on_line.argmax())
    gap_m = math.hypot(x_m[far] - x_m[end], y_m[far] - y_m[end])
    between = no_echo[beyond:far]
    is_pane = THINNED_TO_M < gap_m < GLASS_GAP_M and between.size > 0 and between.mean() > GLASS_SILENT_SHARE
    return far if is_pane else -1


def bridge_glass(seen: SideView, wall: FollowedWall) -> Places | None:
    """Return places x + iy, shape (k,), that fill the pane of glass beyond the front end of the wall, or None."""
    line, far = wall.line, wall.glass_to
    if line is None or far < 0:
        return None
    end = int(wall.beams[-1])
    # Along the line, not from point to point: one noisy end point must not bend the bridge.
    cos, sin = math.cos(line.heading_rad), math.sin(line.heading_rad)
    from_m = cos * seen.x_m[end] + sin * seen.y_m[end]
    to_m = cos * seen.x_m[far] + sin * seen.y_m[far]
    along = np.arange(from_m, to_m, THINNED_TO_M)
    filled: Places = (along + 1j * line.distance_m) * complex(cos, sin)
    return filled


def room_for(seen: SideView, line: WallLine, desired_m: float) -> float:
    """Return D' for the line of the wall on the left."""
    part, line_m = slice(seen.side.opposite_from, None, ROOM_EVERY_BEAM), line.distance_m
    if np.count_nonzero(seen.range_m[part] < 2 * desired_m - line_m + ROOM_REACH_M) < MIN_POINTS:
        return desired_m  # the usual case in the open, at once
    x_m, y_m, solid = seen.x_m[part], seen.y_m[part], seen.solid[part]
    cos, sin = math.cos(line.heading_rad), math.sin(line.heading_rad)
    across = sin * x_m
    across -= cos * y_m
    x_m = cos * x_m
    x_m += sin * y_m
    opposite = across[solid & (np.abs(x_m) < ROOM_BESIDE_M) & (across > 0.0)]
    if opposite.size < MIN_POINTS:
        return desired_m
    nearest = max(1, round(ROOM_NEAREST_SHARE * opposite.size))
    opposite.partition(nearest - 1)
    free_m = line_m + float(opposite[:nearest].mean())
    return free_m / 2 if free_m / 2 < desired_m - ROOM_MIN_GAIN_M else desired_m
