"""Speed profile of the path ahead: lateral grip at each point, and braking in time for it.

v <= sqrt(a_lat / |k|)        now (k of the steering about to be sent) and at each point of the ball's path
v(s)^2 <= v_point^2 + 2 a_brake (s - 0.3 - 0.06 v)
"""

import math
from itertools import pairwise

from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.runtime.control.wall_following.ball_path import RADII_M

LATERAL_SHARE = 0.75
BRAKE_SHARE = 0.54
"""Of mu g; together within the friction circle (0.75^2 + 0.54^2 < 1). With mu 0.65 that is 0.35 g, which the graded
limit of `swept` (0.45 of 0.8 g) lets pass: braking later for a corner ends in its hard stops."""
ROOM_M, NARROW_M = 0.95, 0.8
NARROW_SHARE = 0.77
"""A floor of 0.5 where 0.65 is counted on lets the car run 0.45 m wide in a corner, towards its wall in an inside
corner and away from it in an outside one. A path that comes nearer to a wall than ROOM_M has less room for that and
counts on less, nearer than NARROW_M on this share."""
SHARPEST_PER_M = 0.9
"""Maximum curvature of the car at the path's kinks."""
BACK_FROM_RAD, BACK_WHOLE_RAD, BACK_PER_M = 1.75, 2.1, 1.15
"""A path that turns back, by more than a right angle, keeps the car at the limit of grip until it is wide of it: it
counts as sharper than the car can turn."""
SPAN = 2
"""Number of chords between the two headings whose difference is a point's curvature: fewer amplify the noise."""
CIRCLES = len(RADII_M)
MARGIN_M = 0.3
REACTION_S = 0.06


def mu_with_room(assumed_mu: float, distance_m: float) -> float:
    """Return the assumed friction at this distance from the nearer wall, the followed or the opposite one."""
    less = min(max((ROOM_M - distance_m) / (ROOM_M - NARROW_M), 0.0), 1.0)
    return assumed_mu * (1.0 - less * (1.0 - NARROW_SHARE))


def speed_limit_mps(steering_rad: float, wheelbase_m: float, assumed_mu: float) -> float:
    """Return the speed at which this steering needs all of the assumed lateral grip."""
    curvature = abs(math.tan(steering_rad)) / wheelbase_m
    return math.sqrt(LATERAL_SHARE * assumed_mu * GRAVITY_MPS2 / max(curvature, 1e-6))


def fastest_mps(
    radius_m: tuple[float, ...],
    bearing_rad: tuple[float, ...],
    meets: tuple[bool, ...],
    crosses: tuple[bool, ...],
    speed_mps: float,
    assumed_mu: float,
) -> float:
    """Return the highest speed now from which every point of a BallPath can still be driven.

    Of the circles, which come in growing order, those of RADII_M count; the path ends at the first circle that the wall
    does not meet, and beyond the end a corner of the sharpest curvature is assumed.
    """
    # Nearer circles than the first crossing lie wholly inside or outside of D: the way to the path, not the path.
    circles = min(len(radius_m), CIRCLES)
    begin = next((i for i in range(circles) if crosses[i]), circles)
    end = next((i for i in range(begin, circles) if not meets[i]), circles)
    margin_m = MARGIN_M + REACTION_S * abs(speed_mps)
    lateral, brake = LATERAL_SHARE * assumed_mu * GRAVITY_MPS2, BRAKE_SHARE * assumed_mu * GRAVITY_MPS2
    radius_m, bearing_rad = radius_m[begin:end], bearing_rad[begin:end]
    places = [(r_m * math.cos(b_rad), r_m * math.sin(b_rad)) for r_m, b_rad in zip(radius_m, bearing_rad, strict=True)]
    heading: list[float] = []
    way = [radius_m[0]] if len(radius_m) > 1 else [0.0]
    for (x0, y0), (x1, y1) in pairwise(places):
        heading.append(math.atan2(y1 - y0, x1 - x0))
        way.append(way[-1] + math.hypot(x1 - x0, y1 - y0))
    turned_rad = max((abs(math.remainder(h_rad - heading[0], math.tau)) for h_rad in heading), default=0.0)
    back = min(max((turned_rad - BACK_FROM_RAD) / (BACK_WHOLE_RAD - BACK_FROM_RAD), 0.0), 1.0)
    sharpest_per_m = SHARPEST_PER_M + back * (BACK_PER_M - SHARPEST_PER_M)
    # At the end of what is seen, a corner; before it, at each inner point its own curvature.
    square = lateral / sharpest_per_m + 2 * brake * max(way[-1] - margin_m, 0.0)
    for i in range(len(heading) - SPAN):
        turn_rad = abs(math.remainder(heading[i + SPAN] - heading[i], math.tau))
        curvature = turn_rad / max(way[i + 1 + SPAN] - way[i + 1], 1e-3)
        curvature = min(max(curvature, 1e-3), sharpest_per_m)
        square = min(square, lateral / curvature + 2 * brake * max(way[i + 1] - margin_m, 0.0))
    return math.sqrt(square)
