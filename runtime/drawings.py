"""What the laws see, as drawings in base_link: the followed wall, the way the car is about to sweep, what stops it.

For eyes, not for decisions: the way is drawn as a plain arc of the steering that was sent.
"""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from drivers.api import Drive
from runtime.car_settings import CarSettings
from runtime.command import Output, Source
from runtime.control.guidance import Guidance
from runtime.control.perception import View
from runtime.ros.markers import BLUE, GREEN, ORANGE, RED, Kind, Marker
from runtime.ros.messages import Floats

WALL_FROM_M, WALL_TO_M = -1.0, 3.0
LOOK_S = 1.0
SHORTEST_LOOK_M = 0.5
STEPS = np.linspace(0.0, 1.0, 16)
NEAR_M = 0.15
"""What is so near the outline at the place of contact is taken for what stops the car."""


def wall(guidance: Guidance, side: Literal["left", "right"], ball_m: Floats | None) -> list[Marker]:
    """Return the fitted wall line and the path of the ball.

    ball_m: places of the ball, (2, k), base_link; None where the law has none.
    """
    drawings = []
    # Before a corner the distance is that of the nearest wall, which need not be the one that the line is fitted to.
    away_m = guidance.line_m if math.isfinite(guidance.line_m) else guidance.distance_m
    if math.isfinite(guidance.angle_rad + away_m):
        sign = 1.0 if side == "left" else -1.0
        along = np.array([[math.cos(guidance.angle_rad)], [math.sin(guidance.angle_rad)]])
        aside = sign * np.array([[-along[1, 0]], [along[0, 0]]])
        line = aside * away_m + along * np.array([[WALL_FROM_M, WALL_TO_M]])
        drawings.append(Marker("wall", Kind.LINE_STRIP, line, GREEN))
    if ball_m is not None and ball_m.shape[1]:
        drawings.append(Marker("ball", Kind.LINE_STRIP, ball_m, BLUE))
    return drawings


def footprint(output: Output, car: CarSettings, view: View | None) -> list[Marker]:
    """Return the car's outline, the strip it is about to sweep, what stops it, and the beams that are ignored.

    view: of the newest scan, None where the safety law keeps none.
    """
    drive, decision = output.drive, output.decision
    bound = decision.winner is Source.SAFETY
    travel_m = way_m(drive, decision.measure if bound else math.nan)
    color = GREEN if not bound else ORANGE if drive.speed_mps else RED
    swept = corners(car, drive.steering_rad, travel_m * STEPS)
    drawings = [
        Marker("car", Kind.LINE_STRIP, swept[:, [0, 1, 2, 3, 0], 0], BLUE),
        Marker("left edge", Kind.LINE_STRIP, swept[:, 0], color),
        Marker("right edge", Kind.LINE_STRIP, swept[:, 1], color),
        Marker("end", Kind.LINE_STRIP, swept[:, :2, -1], color),
    ]
    if view is None:
        return drawings
    if bound:
        drawings += _cause(view, car, *pose(drive.steering_rad, travel_m, car.wheelbase_m))
    ignored = np.isfinite(view.ranges_m) & ~view.solid
    points = np.stack([view.x_m[ignored], view.y_m[ignored]])
    return [*drawings, Marker("ignored", Kind.POINTS, points, ORANGE)]


def way_m(drive: Drive, free_m: float) -> float:
    """Return how far ahead to draw, negative backwards: to the contact where one is known, else a second of driving."""
    if math.isfinite(free_m):
        return math.copysign(free_m, drive.speed_mps or 1.0)
    return math.copysign(max(SHORTEST_LOOK_M, LOOK_S * abs(drive.speed_mps)), drive.speed_mps)


def pose(steering_rad: float, travel_m: float, wheelbase_m: float) -> tuple[float, float, float]:
    """Return x, y, yaw of the rear axle after a way on the circle of a steering angle."""
    half_turn_rad = travel_m * math.tan(steering_rad) / wheelbase_m / 2
    chord_m = travel_m * float(np.sinc(half_turn_rad / math.pi))
    return chord_m * math.cos(half_turn_rad), chord_m * math.sin(half_turn_rad), 2 * half_turn_rad


def corners(car: CarSettings, steering_rad: float, travel_m: Floats) -> Floats:
    """Return the corners of the car along its way, (2, 4, n): front left, front right, rear right, rear left."""
    turn_per_m = math.tan(steering_rad) / car.wheelbase_m
    heading = np.exp(1j * turn_per_m * travel_m)
    chord_m = travel_m * np.sinc(turn_per_m * travel_m / math.tau)
    axle_m = chord_m * np.exp(0.5j * turn_per_m * travel_m)
    aside_m = car.half_width_m * 1j
    outline_m = np.array([car.front_m + aside_m, car.front_m - aside_m, -car.rear_m - aside_m, -car.rear_m + aside_m])
    placed = axle_m + outline_m[:, None] * heading
    return np.stack([placed.real, placed.imag])


def _cause(view: View, car: CarSettings, x_m: float, y_m: float, yaw_rad: float) -> Sequence[Marker]:
    """Return the beam to what stops the car: the solid point nearest to the bumper at the place of contact."""
    solid_x_m, solid_y_m = view.x_m[view.solid], view.y_m[view.solid]
    dx, dy = solid_x_m - x_m, solid_y_m - y_m
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    ahead_m, aside_m = cos * dx + sin * dy, np.abs(cos * dy - sin * dx)
    off_m = np.maximum(
        np.maximum(ahead_m - car.front_m, -car.rear_m - ahead_m), aside_m - car.half_width_m
    )  # of a rectangle: negative inside
    if not off_m.size or off_m.min() > NEAR_M:
        return ()
    nearest = int(off_m.argmin())
    hit = np.array([[solid_x_m[nearest]], [solid_y_m[nearest]]])
    beam = np.hstack([np.array([[car.lidar_x_m], [0.0]]), hit])
    return (
        Marker("the beam that stops", Kind.LINE_STRIP, beam, RED, 0.015),
        Marker("what stops", Kind.POINTS, hit, RED, 0.1),
    )
