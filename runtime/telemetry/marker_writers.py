"""Markers of the perception, in base_link: the followed wall, the swept path ahead, the obstacle that stops the car.

For display, not for decisions: the path is drawn as a plain arc of the steering that was sent.
"""

import cmath
import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import Output, Source
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.ros.markers import BLUE, GREEN, ORANGE, RED, Marker, MarkerType
from wallride.runtime.ros.messages import Floats

WALL_ENDS_M = -1.0, 3.0
"""Ends of the drawn wall, along it from the point beside the rear axle."""
LOOK_S = 1.0
MIN_LOOK_M = 0.5
STEPS = 16
SMALL_RAD = 1e-6
"""Maximum turn that is drawn as a straight line."""
NEAR_M = 0.15
"""Maximum distance from the outline at the place of contact of a point that counts as the obstacle."""


def wall(guidance: Guidance, side: Literal["left", "right"], ball_m: Floats | None) -> list[Marker]:
    """Return the fitted wall line and the path of the ball.

    ball_m: places of the ball, (2, k), base_link; None where the law has none.
    """
    drawings = []
    # Before a corner the distance is that of the nearest wall, which need not be the one of the line.
    away_m = guidance.line_m if math.isfinite(guidance.line_m) else guidance.distance_m
    if math.isfinite(guidance.angle_rad + away_m):
        sign = 1.0 if side == "left" else -1.0
        cos, sin = math.cos(guidance.angle_rad), math.sin(guidance.angle_rad)
        foot_x_m, foot_y_m = -sign * sin * away_m, sign * cos * away_m
        line = [[foot_x_m + cos * on_m for on_m in WALL_ENDS_M], [foot_y_m + sin * on_m for on_m in WALL_ENDS_M]]
        drawings.append(Marker("wall", MarkerType.LINE_STRIP, np.array(line), GREEN))
    if ball_m is not None and ball_m.shape[1]:
        drawings.append(Marker("ball", MarkerType.LINE_STRIP, ball_m, BLUE))
    return drawings


def footprint(output: Output, car: CarSettings, view: View | None) -> list[Marker]:
    """Return the car's outline, its swept path, the obstacle that stops it, and the ignored beams.

    view: of the newest scan, None where the safety law keeps none.
    """
    drive, decision = output.drive, output.decision
    bound = decision.winner is Source.SAFETY
    travel_m = way_m(drive, decision.measure if bound else math.nan)
    color = GREEN if not bound else ORANGE if drive.speed_mps else RED
    edges = edges_m(car, drive.steering_rad, travel_m)
    drawings = [
        Marker("car", MarkerType.LINE_STRIP, outline_m(car), BLUE),
        Marker("left edge", MarkerType.LINE_STRIP, edges[0], color),
        Marker("right edge", MarkerType.LINE_STRIP, edges[1], color),
        Marker("end", MarkerType.LINE_STRIP, edges[:, :, -1].T, color),
    ]
    if view is None:
        return drawings
    if bound:
        drawings += _cause(view, car, *pose(drive.steering_rad, travel_m, car.wheelbase_m))
    ignored = (np.isfinite(view.ranges_m) & ~view.solid).nonzero()[0]  # few: places are cheaper than a mask
    points = np.array([view.x_m.take(ignored), view.y_m.take(ignored)])
    return [*drawings, Marker("ignored", MarkerType.POINTS, points, ORANGE)]


def way_m(drive: Drive, free_m: float) -> float:
    """Return the length to draw, negative backwards: up to the contact where one is known, else a second of driving."""
    if math.isfinite(free_m):
        return math.copysign(free_m, drive.speed_mps or 1.0)
    return math.copysign(max(MIN_LOOK_M, LOOK_S * abs(drive.speed_mps)), drive.speed_mps)


def pose(steering_rad: float, travel_m: float, wheelbase_m: float) -> tuple[float, float, float]:
    """Return x, y, yaw of the rear axle after a travel on the circle of a steering angle."""
    half_turn_rad = travel_m * math.tan(steering_rad) / wheelbase_m / 2
    straight = abs(half_turn_rad) < SMALL_RAD
    chord_m = travel_m if straight else travel_m * math.sin(half_turn_rad) / half_turn_rad
    return chord_m * math.cos(half_turn_rad), chord_m * math.sin(half_turn_rad), 2 * half_turn_rad


def edges_m(car: CarSettings, steering_rad: float, travel_m: float) -> Floats:
    """Return the paths of the front left and the front right corner, (2 corners, 2 coordinates, STEPS).

    Both turn about the same centre by the same angle from step to step, which in complex numbers is one product.
    """
    turn_rad = travel_m * math.tan(steering_rad) / car.wheelbase_m
    straight = abs(turn_rad) < 2 * SMALL_RAD
    centre_m = 0.0 if straight else complex(0.0, travel_m / turn_rad)
    turned = 1.0 if straight else cmath.rect(1.0, turn_rad / (STEPS - 1))
    on_m = travel_m / (STEPS - 1) if straight else 0.0
    left_m, right_m = complex(car.front_m, car.half_width_m), complex(car.front_m, -car.half_width_m)
    ways_m: list[complex] = []
    for _ in range(STEPS):
        ways_m += left_m, right_m
        left_m = centre_m + (left_m - centre_m) * turned + on_m
        right_m = centre_m + (right_m - centre_m) * turned + on_m
    return np.array(ways_m).view(np.float64).reshape(STEPS, 2, 2).transpose(1, 2, 0)


def outline_m(car: CarSettings) -> Floats:
    """Return the car's corners, (2, 5), closed."""
    front_m, rear_m, half_m = car.front_m, -car.rear_m, car.half_width_m
    return np.array([[front_m, front_m, rear_m, rear_m, front_m], [half_m, -half_m, -half_m, half_m, half_m]])


def _cause(view: View, car: CarSettings, x_m: float, y_m: float, yaw_rad: float) -> Sequence[Marker]:
    """Return the beam to the obstacle: the solid point nearest to the bumper at the place of contact."""
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
    beam = np.hstack([np.array([[car.lidar_x_m], [car.lidar_y_m]]), hit])
    return (
        Marker("the beam that stops", MarkerType.LINE_STRIP, beam, RED, 0.015),
        Marker("what stops", MarkerType.POINTS, hit, RED, 0.1),
    )
