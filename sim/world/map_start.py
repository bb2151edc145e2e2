"""Start pose of a car on a map: beside a wall that leads on, parallel to it, with a free way ahead.

The same map gives the same start on every machine. Many places are equal to the last bit, so the choice uses numpy's
beams, never compiled ones; compared values are rounded, and the first of equal places is taken.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wallride.sim.world.ball_contour import ENDLESS_M, Places, led_on, places
from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.place import START_DISTANCE_M
from wallride.sim.world.pose import Floats, Pose, Side, side_sign

_BALLS_M = tuple(round(START_DISTANCE_M - 0.1 * step, 1) for step in range(6))
"""Candidate distances of the start from the wall: 1 m to 0.5 m."""
_FAR_ENOUGH_M = 60.0
"""Way [m] beyond which no smaller distance is chosen: a minute at 1 m/s, a lap in a building."""
_MUCH_FARTHER = 1.5
"""Minimum ratio of ways for a smaller distance to be chosen; laws pass a short narrow place by themselves."""
_NEARLY_AS_FAR = 0.8
"""Share of the longest way that counts as good, where no way is endless."""
_START_CANDIDATES = 300
_LOOK_AHEAD_M = 8.0


def choose_start(geometry: GridGeometry, side: Side) -> tuple[Pose, float]:
    """Return a place beside a wall that leads on, parallel to it, with a free way ahead; and its distance from it [m].

    The distance is START_DISTANCE_M, or less where the way of a smaller ball leads much farther. Of 300 cells spread
    over those with the longest drivable way, the one with the longest straight way ahead and behind wins (8 m are
    enough), less what the wall's distance changes within 1 m; to whole millimetres.
    """
    room_m, rolled = _places(geometry, side)
    longest_m = float(rolled.way_m.max())
    least_m = longest_m if longest_m >= ENDLESS_M else _NEARLY_AS_FAR * longest_m
    good = np.flatnonzero(rolled.way_m >= least_m)
    spread = good[np.unique(np.linspace(0, len(good) - 1, _START_CANDIDATES).astype(np.int64))]
    headings = [_heading(geometry, rolled, int(index)) for index in spread]
    poses = _along_the_walls(geometry, headings, side)
    return poses[int(np.argmax(np.round(_worths_m(geometry, poses, side, room_m), 3)))], room_m


def _places(geometry: GridGeometry, side: Side) -> tuple[float, Places]:
    """Return the distance at which to follow a wall, and its places: the largest of `_BALLS_M` that leads far enough.

    Where none does, the one that leads farthest. A map narrower than all of them has only its widest place. Where no
    way is endless at that distance, the ways of a law that comes nearer to the wall in narrow places count, from those
    places on that lead far enough, or nearly farthest, without.
    """
    from scipy import ndimage

    away_m = np.round(ndimage.distance_transform_edt(~geometry.solid) * geometry.cell_m, 6)
    balls_m = [ball_m for ball_m in _BALLS_M if ball_m <= away_m.max()] or [float(away_m.max())]
    rolled: list[Places] = []
    chosen = 0
    for ball_m in balls_m:
        rolled.append(places(away_m, geometry.cell_m, ball_m, side))
        if _far_m(rolled[-1]) > _MUCH_FARTHER * _far_m(rolled[chosen]):
            chosen = len(rolled) - 1
        if rolled[-1].way_m.max() >= ENDLESS_M:
            break
    onward = rolled[-1]
    for larger in reversed(rolled[chosen:-1]):
        onward = led_on(larger, onward, geometry.cell_m)
    alone = rolled[chosen]
    far = alone.way_m >= min(_FAR_ENOUGH_M, _NEARLY_AS_FAR * float(alone.way_m.max()))
    return balls_m[chosen], replace(onward, way_m=np.where(far, onward.way_m, 0.0))


def _far_m(rolled: Places) -> float:
    """Return the longest way of all places, as far as it matters for the distance."""
    return min(float(rolled.way_m.max()), _FAR_ENOUGH_M)


def _heading(geometry: GridGeometry, rolled: Places, index: int) -> Pose:
    """Return the middle of a place's cell, and the direction of the ball's path there."""
    x_m, y_m = geometry.cell_centre(*(int(part) for part in rolled.cell[index]))
    x, y = rolled.heading[index]
    return Pose(x_m, y_m, geometry.origin.yaw_rad + math.atan2(y, x))


def _marched_m(geometry: GridGeometry, places: Sequence[Pose], bearing_rad: Floats) -> Floats:
    """Return the ranges from each place along its bearings, shape (n, k): many beams at once take a tenth of the time.

    bearing_rad: shape (k,), as seen from the heading of each.
    """
    x_m, y_m, yaw_rad = np.array([(at.x_m, at.y_m, at.yaw_rad) for at in places]).T[:, :, None]
    rays_rad = yaw_rad + bearing_rad
    x_m, y_m = (np.broadcast_to(part, rays_rad.shape).ravel() for part in (x_m, y_m))
    return geometry.march(x_m, y_m, rays_rad.ravel()).reshape(rays_rad.shape)


def _along_the_walls(geometry: GridGeometry, headings: Sequence[Pose], side: Side) -> list[Pose]:
    """Return the poses at these points with the nearest wall on one side square to them, near to their headings."""
    bearing_rad = side_sign(side) * np.radians(np.arange(2.0, 180.0, 2.0))
    ranges_m = _marched_m(geometry, headings, bearing_rad)
    return [_square(at, at.yaw_rad + bearing_rad, seen_m, side) for at, seen_m in zip(headings, ranges_m, strict=True)]


def _square(at: Pose, bearings: Floats, ranges_m: Floats, side: Side) -> Pose:
    """Return the pose at a point with the nearest of the walls that it sees square to it."""
    points = np.column_stack([ranges_m * np.cos(bearings), ranges_m * np.sin(bearings)])
    beside = slice(14, -14)  # 30 to 150 degrees
    nearest = 14 + int(np.argmin(ranges_m[beside]))
    aside = np.cos(bearings - bearings[nearest]) > 0.5
    near = points[aside & (ranges_m <= 1.3 * ranges_m[nearest])]  # a patch about 1.6 times as long as its distance
    _, _, axes = np.linalg.svd(near - near.mean(axis=0))
    yaw_rad = math.atan2(axes[0, 1], axes[0, 0])
    centre = near.mean(axis=0)
    wall_is_left = -math.sin(yaw_rad) * centre[0] + math.cos(yaw_rad) * centre[1] > 0
    facing = yaw_rad if wall_is_left == (side == "left") else yaw_rad + math.pi
    return Pose(at.x_m, at.y_m, math.remainder(facing, math.tau))


def _worths_m(geometry: GridGeometry, poses: Sequence[Pose], side: Side, distance_m: float) -> Floats:
    """Return the metres of free way of each pose, less a penalty for the deviation of the wall's distance, (n,)."""
    ranges_m = _marched_m(geometry, poses, np.radians([-4.0, 0.0, 4.0, 176.0, 180.0, 184.0]))
    ahead_m = np.minimum(_LOOK_AHEAD_M, ranges_m[:, :3].min(axis=1))
    behind_m = np.minimum(1.0, ranges_m[:, 3:].min(axis=1))
    sides_rad = side_sign(side) * np.radians(np.linspace(60.0, 120.0, 25))
    along = [pose.ahead(forward_m) for forward_m in (-0.5, 0.0, 0.5, 1.0) for pose in poses]
    walls_m = _marched_m(geometry, along, sides_rad).min(axis=1).reshape(4, -1)
    worth: Floats = ahead_m + behind_m - 20.0 * np.ptp(walls_m, axis=0) - 5.0 * np.abs(walls_m[1] - distance_m)
    return worth
