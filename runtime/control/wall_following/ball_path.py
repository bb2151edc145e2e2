"""Path of a ball that is rolled along the wall, seen from the rear axle.

Around the rear axle lie circles. On each one, looked through from the free side (-85 deg) to the wall side (+85 deg),
the first place that is nearer to the wall than D is on the ball's path: no corner rule. A wall's point at range p and
bearing b is nearer than D to the places of the circle of radius r within b +- h, by the law of cosines

    cos h = (r^2 + p^2 - D^2) / (2 r p)

so the first place is the least b - h of all points, unless the free end itself lies within one of them.
"""

import cmath
import math
from typing import Any, NamedTuple

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats, Places
from wallride.runtime.control.perception.noise_bias import learn_bias_m, roughness_m
from wallride.runtime.control.wall_following.followed_wall import FollowedWall, SideView, around, bridge_glass, outline
from wallride.runtime.control.wall_following.prediction import Shift
from wallride.runtime.control.wall_following.wall_fit import CLEAN_INLIERS

MAX_ANGLE_RAD = math.radians(85)
RADII_M = tuple(np.linspace(0.3, 3.0, 10).tolist())
"""Radii of the circles of the path, up to the horizon of the speed profile."""
_BEND_CIRCLES = 1, 5
"""From which circle to before which the bend of the path is measured: 0.6 to 1.5 m."""
OPPOSITE_EVERY = 4
"""Interval of the examined beams among those that may see the other side of the path."""


@value(eq=False)
class BallPath:
    """The ball on each circle, all (k,).

    crosses: the path really crosses the circle there. meets: the wall is within D somewhere on it; where it meets but
    does not cross, even the place farthest to the free side is too near, and that place is the answer. Where it does
    not meet, the answer is the bearing nearest to the wall.
    """

    radius_m: tuple[float, ...]
    bearing_rad: tuple[float, ...]
    meets: tuple[bool, ...]
    crosses: tuple[bool, ...]

    def first(self, count: int) -> "BallPath":
        """Return the part on the first circles."""
        return BallPath(self.radius_m[:count], self.bearing_rad[:count], self.meets[:count], self.crosses[:count])


@value(eq=False)
class Rollout:
    """A ball rolled along the wall as seen from the pose at which the answer takes effect.

    nearest_m: the nearest of the wall's points. bias_m: how much nearer than the line that is; rough_m: the part of it
    that is the wall's own roughness, see `noise_bias`.
    bend_per_m: curvature of the path between 0.6 and 1.5 m ahead, left positive; 0 where it is not all seen.
    opposite_m: least distance of the path to points beyond the followed wall's front end, infinite without any.
    """

    path: BallPath
    nearest_m: float
    bias_m: float
    rough_m: float
    bend_per_m: float
    opposite_m: float


class Ball(NamedTuple):
    """The ball and what was learnt before this scan: bias_m and noise_m, see `noise_bias`; desired_m: its radius."""

    bias_m: float
    noise_m: float
    desired_m: float


def roll_path(seen: SideView, wall: FollowedWall, shift: Shift, ball: Ball, more_radii_m: tuple[float, ...]) -> Rollout:
    """Roll a ball of the desired distance, less the bias, along the followed wall, panes of glass filled in.

    The circles are RADII_M, then `more_radii_m`.
    """
    radii_m = RADII_M + more_radii_m
    nearest_m, bias_m, bend_per_m, opposite_m, path_rad, meets, crosses = roll_ball(
        seen, wall, bridge_glass(seen, wall), shift, ball, radii_m
    )
    rough_m = roughness_m(bias_m, ball.noise_m)
    return Rollout(BallPath(radii_m, path_rad, meets, crosses), nearest_m, bias_m, rough_m, bend_per_m, opposite_m)


Circles = tuple[tuple[float, ...], tuple[bool, ...], tuple[bool, ...]]
"""bearing_rad, meets and crosses of a BallPath."""


def _clean_line(wall: FollowedWall) -> tuple[float, float]:
    """Return distance and heading of the wall's line, NaN and 0 without a clean one."""
    if wall.line is not None and wall.line.inliers > CLEAN_INLIERS:
        return wall.line.distance_m, wall.line.heading_rad
    return math.nan, 0.0


def _flat_ball(
    seen: SideView, wall: FollowedWall, glass_m: Places | None, shift: Shift, ball: Ball, radii_m: tuple[float, ...]
) -> tuple[Any, ...]:
    return (
        seen.x_m, seen.y_m, seen.solid, wall.beams, glass_m, shift.x_m, shift.y_m, shift.yaw_rad, *_clean_line(wall),
        ball.bias_m, ball.noise_m, ball.desired_m, radii_m,
    )  # fmt: skip


@accelerated(flat=_flat_ball)
def roll_ball(
    seen: SideView, wall: FollowedWall, glass_m: Places | None, shift: Shift, ball: Ball, radii_m: tuple[float, ...]
) -> tuple[float, float, float, float, tuple[float, ...], tuple[bool, ...], tuple[bool, ...]]:
    """Return nearest_m, bias_m, bend_per_m and opposite_m of Rollout, then bearing_rad, meets and crosses of its path.

    The wall is seen from the pose of `shift`; all else is given as seen from the origin.
    """
    x_m, y_m, solid, (line_m, line_rad) = seen.x_m, seen.y_m, seen.solid, _clean_line(wall)
    from_x_m, from_y_m, yaw_rad = shift.x_m, shift.y_m, shift.yaw_rad
    places_m = outline(x_m, y_m, wall.beams)
    if glass_m is not None:
        places_m = np.concatenate((places_m, glass_m))
    range_m, bearing_rad, nearest_m = around(places_m, from_x_m, from_y_m, yaw_rad)
    line_m -= math.cos(line_rad) * from_y_m - math.sin(line_rad) * from_x_m
    bias_m = learn_bias_m(ball.bias_m, line_m, nearest_m)
    ball_m = ball.desired_m - bias_m + roughness_m(bias_m, ball.noise_m)
    path_rad, meets, crosses = circles_met(range_m, bearing_rad, ball_m, radii_m)
    part = slice(*_BEND_CIRCLES)
    bend_per_m = bend_of(radii_m[part], path_rad[part]) if all(meets[part]) else 0.0
    crossed = [
        complex(r_m * math.cos(b_rad), r_m * math.sin(b_rad))
        for r_m, b_rad, crossing in zip(radii_m[: len(RADII_M)], path_rad, crosses, strict=False)
        if crossing
    ]
    beyond = slice(int(wall.beams[-1]) + 1, None, OPPOSITE_EVERY)
    there_m = np.array(crossed, np.complex128) * cmath.rect(1.0, yaw_rad) + complex(from_x_m, from_y_m)
    opposite_m = apart_m(there_m, x_m[beyond][solid[beyond]], y_m[beyond][solid[beyond]])
    return nearest_m, bias_m, bend_per_m, opposite_m, path_rad, meets, crosses


def apart_m(places_m: Places, x_m: Floats, y_m: Floats) -> float:
    """Return the least distance between places x + iy, (k,), and points, (n,); infinite without any."""
    dx = np.subtract.outer(places_m.real, x_m)
    dy = np.subtract.outer(places_m.imag, y_m)
    return math.sqrt(float((dx * dx + dy * dy).min(initial=math.inf)))


def circles_met(range_m: Floats, wall_rad: Floats, ball_m: float, radii_m: tuple[float, ...]) -> Circles:
    """Return where a ball, rolled along a wall of these ranges and bearings (n,), is on each circle."""
    radius_m = np.array(radii_m)
    by_point = np.empty((2, range_m.size))
    by_point[0] = 0.5 / range_m
    by_point[1] = 0.5 * range_m - (ball_m * ball_m) * by_point[0]
    by_circle = np.empty((radius_m.size, 2))
    by_circle[:, 0] = radius_m
    by_circle[:, 1] = 1.0 / radius_m
    cos = by_circle @ by_point
    far = cos > 1.0
    np.minimum(cos, 1.0, out=cos)
    half_rad = np.arccos(np.maximum(cos, -1.0, out=cos), out=cos)
    from_free_rad = (wall_rad + MAX_ANGLE_RAD) % math.tau
    all_round = (from_free_rad + half_rad).max(axis=1) > math.tau
    edge_rad = np.subtract(from_free_rad, half_rad, out=half_rad)
    edge_rad[far] = math.inf
    first_rad = edge_rad.min(axis=1)
    at_once = all_round | (first_rad < 0.0)
    crosses = ~at_once & (first_rad <= 2 * MAX_ANGLE_RAD)
    meets = at_once | crosses
    bearing_rad = np.where(crosses, first_rad, 0.0) - MAX_ANGLE_RAD
    if not meets.all():
        bearing_rad[~meets] = _nearest_rad(range_m, wall_rad, radius_m[~meets])
    return tuple(bearing_rad.tolist()), tuple(meets.tolist()), tuple(crosses.tolist())


def _nearest_rad(range_m: Floats, wall_rad: Floats, radius_m: Floats) -> Floats:
    """Return the bearing on each circle that is nearest to the wall, shape (k,)."""
    aim_rad = np.clip(wall_rad, -MAX_ANGLE_RAD, MAX_ANGLE_RAD)
    along_m = range_m * np.cos(wall_rad - aim_rad)
    apart2 = range_m * range_m - 2.0 * np.multiply.outer(radius_m, along_m)  # and r^2, the same for all
    nearest: Floats = aim_rad[apart2.argmin(axis=1)]
    return nearest


def bend_of(radius_m: tuple[float, ...], bearing_rad: tuple[float, ...]) -> float:
    """Return the curvature [1/m] of a path over four circles, left positive.

    Difference of the headings of the first and the last of three chords over the way between their middles: a straight
    path gives 0 wherever the car stands.
    """
    circles = zip(radius_m, bearing_rad, strict=True)
    (x0, y0), (x1, y1), (x2, y2), (x3, y3) = ((r * math.cos(b), r * math.sin(b)) for r, b in circles)
    turn_rad = math.atan2(y3 - y2, x3 - x2) - math.atan2(y1 - y0, x1 - x0)
    way_m = (math.hypot(x2 - x0, y2 - y0) + math.hypot(x3 - x1, y3 - y1)) / 2
    return math.remainder(turn_rad, math.tau) / max(way_m, 1e-3)
