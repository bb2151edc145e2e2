"""Swept footprint: the strip of floor that the car's outline sweeps along its predicted arc, and the contacts in it.

The path is that of the rear axle (base_link at the scan is the origin): for the latency the wheels keep their present
angle, then they slew to the commanded one at the servo's rate, and the tyres allow no more curvature than the grip that
is left for turning (k = a / v^2). In a bend the car drifts: its rear axle moves outward by the slip angle v^2 k / (mu g
C), with C the cornering stiffness per load (single-track model, small angles). Footprint collision along a predicted
arc is the idea of nav2's collision monitor ("approach") and of Autoware's emergency braking.

Points and poses are complex numbers x + iy: a rotation is one multiplication with exp(i angle) for all points.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import ENOUGH_POINTS, Booleans, Floats, Places

STEP_M = 0.06
POSES_AT_ONCE = 24
"""Number of poses swept at once on a long path: the boxes are tighter, and a contact ends the computation early."""
NOSE_STEP_M = 0.06
MIN_SLEW_SPEED_MPS = 0.3
"""Minimum speed assumed for the slew: the wheels of a standing car would otherwise be turned before it has moved."""


@value()
class Outline:
    """The car as a rectangle in base_link, margins included; rear_m is measured backwards."""

    front_m: float
    rear_m: float
    half_width_m: float

    def holds(self, points_m: Places) -> Booleans:
        """Return which points (k,) in base_link are within the outline."""
        inside: Booleans = np.abs(points_m.imag) <= self.half_width_m
        inside &= points_m.real <= self.front_m
        inside &= points_m.real >= -self.rear_m
        return inside


class PathMotion(NamedTuple):
    """Motion of the car at the beginning of the path.

    speed_mps: magnitude, >= 0. direction: +1 forward, -1 backward. wheel_rad: angle of the wheels now.
    latency_s: until a new steering command takes effect. rate_radps: of the servo. wheelbase_m: converts an angle to a
    curvature. turning_mps2: maximum lateral acceleration by the tyres. slip_rad_per_mps2: angle by which the rear axle
    drifts outward, per lateral acceleration. along_mps2: longitudinal acceleration until the speed is end_mps.
    """

    speed_mps: float
    direction: float
    wheel_rad: float
    latency_s: float
    rate_radps: float
    wheelbase_m: float
    turning_mps2: float = math.inf
    slip_rad_per_mps2: float = 0.0
    along_mps2: float = 0.0
    end_mps: float = 0.0


@value(eq=False)
class AxlePath:
    """Poses of the rear axle, one every STEP_M: travelled distance, place, heading as a direction; shapes (n,)."""

    travel_m: Floats
    place_m: Places
    heading: Places
    curvature_per_m: Floats

    def part(self, first: int, last: int) -> "AxlePath":
        """Return some of the poses."""
        piece = slice(first, last)
        return AxlePath(self.travel_m[piece], self.place_m[piece], self.heading[piece], self.curvature_per_m[piece])


@value()
class Contact:
    """First contact in the strip.

    travel_m: distance the car can drive before the contact, infinity without one.
    aside_m: lateral place on the bumper, left positive, of the point nearest to the middle; 0 with points on each side.
    curvature_per_m: of the path there. slippery: found on the wider arc of a slippery floor.
    """

    travel_m: float
    aside_m: float
    curvature_per_m: float
    slippery: bool = False


NOTHING = Contact(math.inf, 0.0, 0.0)
Touch = tuple[float, float, float]
"""travel_m, aside_m and curvature_per_m of a contact."""


def arc(motion: PathMotion, steering_rad: float, length_m: float) -> AxlePath:
    """Return the path of a steering command; the first pose is one step ahead."""
    steps = max(1, math.ceil(length_m / STEP_M))
    travel_m = STEP_M * np.arange(1, steps + 1, dtype=np.float64)
    curvature = _curvatures(motion, steering_rad, travel_m)
    step_m = motion.direction * STEP_M
    yaw_rad = curvature.cumsum()
    yaw_rad *= step_m
    heading = np.exp(1j * yaw_rad)
    # The direction of motion in the middle of each step, turned outward by the slip.
    square = motion.speed_mps * motion.speed_mps
    back_rad = curvature * (step_m / 2 + square * motion.slip_rad_per_mps2)
    moved = np.exp(1j * (yaw_rad - back_rad))
    moved *= step_m
    return AxlePath(travel_m, moved.cumsum(), heading, curvature)


def _curvatures(motion: PathMotion, steering_rad: float, travel_m: Floats) -> Floats:
    """Return the curvature at each pose: that of the wheels' angle, limited by the grip of the tyres."""
    change_rad = steering_rad - motion.wheel_rad
    if change_rad:
        turned_rad = travel_m * (motion.rate_radps / max(motion.speed_mps, MIN_SLEW_SPEED_MPS))
        turned_rad -= motion.latency_s * motion.rate_radps
        np.minimum(turned_rad, abs(change_rad), out=turned_rad)
        np.maximum(turned_rad, 0.0, out=turned_rad)
        turned_rad *= math.copysign(1.0, change_rad)
        turned_rad += motion.wheel_rad
        curvature: Floats = np.tan(turned_rad, out=turned_rad)
        curvature /= motion.wheelbase_m
    else:
        curvature = np.full(travel_m.shape, math.tan(steering_rad) / motion.wheelbase_m)
    square = motion.speed_mps * motion.speed_mps
    sharpest = max(abs(math.tan(steering_rad)), abs(math.tan(motion.wheel_rad))) / motion.wheelbase_m
    if max(square, motion.end_mps * motion.end_mps) * sharpest <= motion.turning_mps2:
        return curvature
    if motion.along_mps2:
        squares = square + 2 * motion.along_mps2 * travel_m
        end = motion.end_mps * motion.end_mps
        squares = np.minimum(squares, end) if motion.along_mps2 > 0 else np.maximum(squares, max(end, 0.01))
        most: Floats | float = motion.turning_mps2 / squares
    else:
        most = motion.turning_mps2 / square
    limited: Floats = np.minimum(np.maximum(curvature, -most), most)
    return limited


def contact_on_arc(
    motion: tuple[float, ...], steering_rad: float, length_m: float, outline: Outline, points_m: Places
) -> Contact:
    """Return the `first_contact` on the `arc` of the fields of a `PathMotion`, without building the path."""
    touch = sweep_arc(steering_rad, length_m, points_m, outline, motion)
    return NOTHING if touch is None else Contact(*touch)


def _flat_sweep(
    steering_rad: float, length_m: float, points_m: Places, outline: Outline, motion: tuple[float, ...]
) -> tuple[Any, ...]:
    return steering_rad, length_m, points_m, outline.front_m, outline.rear_m, outline.half_width_m, *motion


@accelerated(flat=_flat_sweep)
def sweep_arc(
    steering_rad: float, length_m: float, points_m: Places, outline: Outline, motion: tuple[float, ...]
) -> Touch | None:
    """Return travel_m, aside_m and curvature_per_m of the first contact on an arc, or None.

    motion: fields of a `PathMotion`.
    """
    begun = PathMotion(*motion)
    return _touch(arc(begun, steering_rad, length_m), outline, points_m, begun.direction)


def first_contact(path: AxlePath, outline: Outline, points_m: Places, direction: float = 1.0) -> Contact:
    """Return where the outline first holds three of points_m (k,), base_link at the scan.

    The travel is exact at the bumper (the third-deepest point) and up to one step too short at the flank.
    """
    touch = sweep_path(path, outline, points_m, direction)
    return NOTHING if touch is None else Contact(*touch)


def _flat_path(path: AxlePath, outline: Outline, points_m: Places, direction: float) -> tuple[Any, ...]:
    return (
        path.travel_m, path.place_m, path.heading, path.curvature_per_m,
        points_m, outline.front_m, outline.rear_m, outline.half_width_m, direction,
    )  # fmt: skip


@accelerated(flat=_flat_path)
def sweep_path(path: AxlePath, outline: Outline, points_m: Places, direction: float) -> Touch | None:
    """Return travel_m, aside_m and curvature_per_m of the first contact on a path, or None."""
    return _touch(path, outline, points_m, direction)


def _touch(path: AxlePath, outline: Outline, points_m: Places, direction: float) -> Touch | None:
    points_m = _in_reach(path, outline, points_m)
    if points_m.size < ENOUGH_POINTS:
        return None
    for first in range(0, path.travel_m.size, POSES_AT_ONCE):
        found = _first_in(path.part(first, first + POSES_AT_ONCE), outline, points_m, direction)
        if found is not None:
            return found
    return None


def _first_in(path: AxlePath, outline: Outline, points_m: Places, direction: float) -> Touch | None:
    near_m = _in_reach(path, outline, points_m)
    if near_m.size < ENOUGH_POINTS:
        return None
    seen = (near_m - path.place_m[:, None]) * path.heading.conj()[:, None]
    ahead_m, aside_m = seen.real, seen.imag
    inside = np.abs(aside_m) <= outline.half_width_m
    inside &= ahead_m <= outline.front_m
    inside &= ahead_m >= -outline.rear_m
    enough = np.count_nonzero(inside, axis=1) >= ENOUGH_POINTS
    pose = int(enough.argmax())
    if not enough[pose]:
        return None
    touched = inside[pose]
    ahead_m, aside_m = ahead_m[pose, touched], aside_m[pose, touched]
    depth_m = outline.front_m - ahead_m if direction > 0 else outline.rear_m + ahead_m
    third_m = float(np.partition(depth_m, -ENOUGH_POINTS)[-ENOUGH_POINTS])
    travel_m = float(path.travel_m[pose])
    travel_m = max(travel_m - STEP_M, travel_m - third_m)
    return travel_m, _innermost_m(aside_m), float(path.curvature_per_m[pose])


def _in_reach(path: AxlePath, outline: Outline, points_m: Places) -> Places:
    """Return the points in a box that contains this piece of the strip: most of a scan is outside.

    The outline turns about the rear axle, so the box contains it at every heading. The lateral limit is applied first:
    it leaves few points of a corridor.
    """
    middle_m, half_m = (outline.front_m - outline.rear_m) / 2, (outline.front_m + outline.rear_m) / 2
    centre = path.place_m + middle_m * path.heading
    y_m, steepest = centre.imag, float(np.abs(path.heading.imag).max())
    wide_m = half_m * steepest + outline.half_width_m
    aside_m = points_m.imag
    inside = aside_m <= y_m.max() + wide_m
    inside &= aside_m >= y_m.min() - wide_m
    near_m: Places = points_m.take(inside.nonzero()[0])
    if not near_m.size:
        return near_m
    x_m, ahead_m = centre.real, near_m.real
    wide_m = half_m + outline.half_width_m * steepest
    inside = ahead_m <= x_m.max() + wide_m
    inside &= ahead_m >= x_m.min() - wide_m
    within_m: Places = near_m.take(inside.nonzero()[0])
    return within_m


def _innermost_m(aside_m: Floats) -> float:
    """Return the lateral place nearest to the car's middle line; 0 with points on both sides of it."""
    low_m, high_m = float(aside_m.min()), float(aside_m.max())
    if low_m > 0:
        return low_m
    return high_m if high_m < 0 else 0.0


@accelerated
def slide_room_m(places_m: Places, course: Places, points_m: Places, front_m: float, half_width_m: float) -> Floats:
    """Return how far the nose may go straight on from each pose (n,), up to the third of points_m (k,); inf without.

    course: direction of motion, (n,). Points up to NOSE_STEP_M behind the nose count: it enters them with this step.
    """
    seen = (points_m - places_m[:, None]) * course.conj()[:, None]
    ahead_m = seen.real - front_m
    met = (np.abs(seen.imag) <= half_width_m) & (ahead_m > -NOSE_STEP_M)
    ahead_m[~met] = np.inf
    ahead_m.sort(axis=1)
    third: Floats = ahead_m[:, ENOUGH_POINTS - 1].copy()
    return third
