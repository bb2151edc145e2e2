"""The strip of floor that the car's outline sweeps along the arc it will really drive, and what stands in it.

The path is that of the rear axle (base_link at the scan is the origin): for the latency the wheels keep their present
angle, then they slew to the commanded one at the servo's rate, and the tyres allow no more curvature than their grip
(k = mu g / v^2). In a bend the car drifts: its rear axle moves outward by the slip angle v^2 k / (mu g C), with C the
cornering stiffness per load (single-track model, small angles). Footprint collision along a predicted arc is the idea
of nav2's collision monitor ("approach") and of Autoware's emergency braking.
"""

import math
from dataclasses import dataclass

import numpy as np

from runtime.control.geometry import Floats

STEP_M = 0.06
POSES_AT_ONCE = 24
"""A long way is swept piece by piece: the boxes are tighter, and the rest is spared when there is a contact."""
ENOUGH_POINTS = 3
"""So many points in the strip are a thing; fewer are noise (2 % wild beams)."""

EDGE_M = 0.05
"""What reaches so little into the strip is beside the car, not before it."""


@dataclass(frozen=True, slots=True)
class Outline:
    """The car as a rectangle in base_link, margins included; rear_m is measured backwards."""

    front_m: float
    rear_m: float
    half_width_m: float


@dataclass(frozen=True, slots=True)
class Motion:
    """How the car moves while the path begins.

    speed_mps: how fast, >= 0. direction: +1 forward, -1 backward. wheel_rad: angle of the wheels now.
    latency_s: until a new steering command shows. rate_radps: of the servo. wheelbase_m, grip_per_m: the tightest
    curvatures that mechanics (through the wheel angle) and tyres allow. slip_m: angle by which the rear axle drifts
    outward, per curvature [rad m].
    """

    speed_mps: float
    direction: float
    wheel_rad: float
    latency_s: float
    rate_radps: float
    wheelbase_m: float
    grip_per_m: float
    slip_m: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Poses of the rear axle, one every STEP_M: travelled distance, x, y, heading, curvature; shapes (n,)."""

    travel_m: Floats
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    curvature_per_m: Floats


@dataclass(frozen=True, slots=True)
class Contact:
    """The first thing in the strip.

    travel_m: how far the car can go before it touches it, infinity when there is nothing.
    side: +1 or -1 when everything touched is at the left or right edge of the strip; 0 ahead.
    curvature_per_m: of the path there. slippery: found on the wider arc of a slippery floor.
    """

    travel_m: float
    side: int
    curvature_per_m: float
    slippery: bool = False


NOTHING = Contact(math.inf, 0, 0.0)


def arc(motion: Motion, steering_rad: float, length_m: float) -> Path:
    """Return the path that a steering command leads to; the first pose is one step on."""
    steps = max(1, math.ceil(length_m / STEP_M))
    travel_m: Floats = STEP_M * np.arange(1, steps + 1, dtype=np.float64)
    slewing_s = np.maximum(travel_m / max(motion.speed_mps, 0.3) - motion.latency_s, 0.0)
    change_rad = steering_rad - motion.wheel_rad
    turned_rad = np.minimum(slewing_s * motion.rate_radps, abs(change_rad))
    wheel_rad = motion.wheel_rad + math.copysign(1.0, change_rad) * turned_rad
    curvature = np.tan(wheel_rad) / motion.wheelbase_m
    if math.isfinite(motion.grip_per_m):
        curvature = np.minimum(np.maximum(curvature, -motion.grip_per_m), motion.grip_per_m)
    step_m = motion.direction * STEP_M
    yaw_rad = np.cumsum(curvature) * step_m
    middle_rad = yaw_rad - curvature * (step_m / 2 + motion.slip_m)
    x_m, y_m = np.cumsum(np.cos(middle_rad)) * step_m, np.cumsum(np.sin(middle_rad)) * step_m
    return Path(travel_m, x_m, y_m, yaw_rad, curvature)


def first_contact(path: Path, outline: Outline, points_m: Floats, direction: float = 1.0) -> Contact:
    """Return where the outline first holds three points of points_m (2, k), base_link at the scan.

    The travel is exact at the bumper (the third-deepest point) and up to one step too short at the flank.
    """
    for first in range(0, path.travel_m.size, POSES_AT_ONCE):
        piece = slice(first, first + POSES_AT_ONCE)
        some = Path(
            path.travel_m[piece], path.x_m[piece], path.y_m[piece], path.yaw_rad[piece], path.curvature_per_m[piece]
        )
        found = _first_in(some, outline, points_m, direction)
        if found is not NOTHING:
            return found
    return NOTHING


def _first_in(path: Path, outline: Outline, points_m: Floats, direction: float) -> Contact:
    near_m = _in_reach(path, outline, points_m)
    if near_m.shape[1] < ENOUGH_POINTS:
        return NOTHING
    ahead_m, aside_m = _in_car_frames(path, near_m)
    inside = (np.abs(aside_m) <= outline.half_width_m) & (ahead_m <= outline.front_m) & (ahead_m >= -outline.rear_m)
    enough = np.count_nonzero(inside, axis=1) >= ENOUGH_POINTS
    pose = int(enough.argmax())
    if not enough[pose]:
        return NOTHING
    touched = inside[pose]
    ahead_m, aside_m = ahead_m[pose, touched], aside_m[pose, touched]
    depth_m = outline.front_m - ahead_m if direction > 0 else outline.rear_m + ahead_m
    third_m = float(np.partition(depth_m, -ENOUGH_POINTS)[-ENOUGH_POINTS])
    travel_m = float(path.travel_m[pose])
    travel_m = max(travel_m - STEP_M, travel_m - third_m)
    return Contact(travel_m, _flank(aside_m, outline), float(path.curvature_per_m[pose]))


def _in_reach(path: Path, outline: Outline, points_m: Floats) -> Floats:
    """Return the points in a box that holds this piece of the strip: most of a scan is outside.

    The outline's middle is reached by turning about the rear axle, so the box has room for it at every heading.
    """
    middle_m, half_m = (outline.front_m - outline.rear_m) / 2, (outline.front_m + outline.rear_m) / 2
    cos, sin = np.cos(path.yaw_rad), np.sin(path.yaw_rad)
    centre_x, centre_y = path.x_m + middle_m * cos, path.y_m + middle_m * sin
    cos, sin = np.abs(cos), np.abs(sin)
    wide_x, wide_y = half_m * cos + outline.half_width_m * sin, half_m * sin + outline.half_width_m * cos
    x_m, y_m = points_m
    inside = (x_m >= (centre_x - wide_x).min()) & (x_m <= (centre_x + wide_x).max())
    inside &= (y_m >= (centre_y - wide_y).min()) & (y_m <= (centre_y + wide_y).max())
    return points_m[:, inside]


def _in_car_frames(path: Path, points_m: Floats) -> tuple[Floats, Floats]:
    """Return x and y of every point seen from every pose, shapes (poses, points)."""
    cos, sin = np.cos(path.yaw_rad), np.sin(path.yaw_rad)
    ahead_m = np.outer(cos, points_m[0]) + np.outer(sin, points_m[1]) - (cos * path.x_m + sin * path.y_m)[:, None]
    aside_m = np.outer(cos, points_m[1]) - np.outer(sin, points_m[0]) + (sin * path.x_m - cos * path.y_m)[:, None]
    return ahead_m, aside_m


def _flank(aside_m: Floats, outline: Outline) -> int:
    """Return the side at whose edge (5 cm) all points are; 0 where one of them is farther in."""
    if float(np.abs(aside_m).min()) <= outline.half_width_m - EDGE_M or (aside_m.min() > 0) != (aside_m.max() > 0):
        return 0
    return 1 if aside_m[0] > 0 else -1
