"""Steering law of the rolling ball: from the ball's path to a steering angle, wall on the left.

    steering = kd (approach(e) + a + slip) - trim, or the tightest turn where a corner leaves no other

    e: distance error. a: heading of the path where the car is, so the wanted heading is a + approach(e).

The shortest way back to a line for a car with a tightest arc 1/c is that arc, then the opposite one, tangent to the
line (Dubins 1957). At distance e the second arc has the heading acos(1 - c |e|): steering hard until the car heads so,
and as hard the other way from there on, is what the optimum of `wallride.sim.lab.limit` does as well. `approach` is
that heading; near the line, where its slope would be infinite, it is the straight kp e / kd (a square-root controller,
as PX4 and ArduPilot call it).

Gains are those at 1 m/s. A heading error decays within L / (v kd), a small distance error within kd / (v kp): a faster
car is given the same 0.07 s and 0.33 s by kd / v and kp / v^2. Beside a wall that is not one straight line a slow car
has less: what the ball shows from one bump to the next is not worth turning for.

a is the bearing of the path a few tenths of a metre ahead, HERE, less what of it belongs to e. On an arc of curvature c
that is c HERE / 2, and kd times that is about what the arc needs (pure pursuit, Coulter 1992): a bend needs no
feed-forward of its own, and acts when the car comes to it, not before. What is fed forward is only how far a car's
heading differs from its path's on a bend, the slip of the rear axle, c v^2 (SLIP + SLIP_PER_MPS v). It is the linear
tyre's a / (mu g C) (C = 5.46 per rad of f1tenth_gym) at a high guess of mu, because the law adds to what the look-ahead
gives; tyres that saturate take more of it at speed. c is the difference of two bearings, HERE and twice as far away.

Kinks in the path turn away from the wall (inside corners), and no car rounds them without beginning before them. The
way left until the car must turn as sharply as it can is a matter of geometry: the tightest circle that touches the
car's heading now or later, and the path behind the corner (`turn_share`).
"""

import math
from typing import NamedTuple

from wallride.runtime.control.wall_following.ball_path import MAX_ANGLE_RAD, BallPath

SLOW_MPS = 1.0
"""Speed up to which the gains equal the settings."""
ARC_M = 0.933
ARC_S = 0.45
"""Part of the radius of the approach's arc, ARC_M + ARC_S v, that grows with the speed: the tightest arc, plus the
distance on which the servo slews from one stop to the other (0.21 s) and the tyres follow."""
MIN_ARC_SHARE = 0.4
"""Minimum share of the arc's curvature that remains beside a path that bends."""
MAX_SLOPE_RAD = 1.4
HERE_M, HERE_S = 0.25, 0.08
"""Look-ahead for the path's present heading: nearer there is noise, farther there is the next bend."""
BEND_HERE = 2.0
"""Factor of that look-ahead at which the path's curvature is taken."""
HERE_WHOLE, HERE_NONE = 0.35, 0.7
"""Shares of that distance: a car that is farther off its path looks at the farther circle of the settings."""
ROUGH_KD_SHARE = 0.4
"""Share of kd used beside a wall that is not straight, unless the speed reduces kd further."""
NOT_TOWARDS_RAD = 0.1
"""Maximum heading towards the wall beyond that of the path at the long look-ahead: the car drives into no niche."""
TURN_M, TURN_S = 0.8, 0.14
"""Radius of the turn round a kink: TURN_M + TURN_S v, as sharp as the car can, or as a fast one may."""
TURN_AHEAD_S, TURN_RAMP_M = 0.06, 0.2
"""Lead time of a turn before its place, for the servo's slewing, and the distance before that over which it grows."""
TURN_FROM_RAD, TURN_WHOLE_RAD, TURN_TO_RAD = 0.15, 0.35, 2.3
"""Angles by which a kink turns away from the car's heading: less is a bend or noise, more is not a corner."""
TURN_CIRCLES = 7
"""Number of circles of the path, 2.1 m, that are searched for corners: the ball's way round the end of the visible
wall, which is no corner, is farther away."""
STRAIGHT_RAD, NOT_STRAIGHT_RAD = 0.06, 0.12
STRAIGHT_PER_M, BENT_PER_M = 0.05, 0.1
"""Limits, of the ball's bearing from the one expected by the wall's line and of the path's curvature, between which the
steering changes from the line to the ball."""
MIN_BEND_PER_M, MAX_BEND_PER_M = -0.3, 1.07
"""A path that turns away from the wall more sharply is a kink; towards it no car turns more sharply."""
SLIP_S2_PER_M, SLIP_S3_PER_M2 = 0.011, 0.0065


def look_aheads_m(look_ahead_m: float, look_ahead_s: float, speed_mps: float) -> tuple[float, float, float]:
    """Return the distances at which the law needs the ball: for heading, curvature, and a larger distance error."""
    here_m = HERE_M + HERE_S * abs(speed_mps)
    return here_m, BEND_HERE * here_m, look_ahead_m + look_ahead_s * abs(speed_mps)


class Aim(NamedTuple):
    """Where the car is beside its path, and how fast.

    error_m: of the nearest point. line_rad, line_error_m: the tracked line's heading, NaN where none is tracked, and
    the error by it. mean_bend_per_m: of the path, over time.
    """

    error_m: float
    line_rad: float
    line_error_m: float
    mean_bend_per_m: float
    speed_mps: float


class Steered(NamedTuple):
    """The steered car: gains at 1 m/s, wheelbase.

    trim_rad: at which the wheels stand while the servo stands in the middle. most_rad: the steering's end.
    """

    kp: float
    kd: float
    wheelbase_m: float
    trim_rad: float
    most_rad: float


def pursuit_steering(path: BallPath, aim: Aim, car: Steered) -> tuple[float, float, float, float]:
    """Return the error, the path's heading, how far the wall is one straight line (0 to 1), and the steering angle.

    The last three circles of the path are those of `look_aheads_m`.
    """
    radius_m, bearing_rad, crosses = path.radius_m, path.bearing_rad, path.crosses
    error_m, line_rad, line_error_m, mean_bend_per_m, speed_mps = aim
    kp, kd, wheelbase_m = car.kp, car.kd, car.wheelbase_m
    here_m, twice_m, near_m = radius_m[-3:]
    near_rad = bearing_rad[-1]
    from_here_rad = bearing_rad[-3] - _asin(error_m / here_m)
    from_twice_rad = bearing_rad[-2] - _asin(error_m / twice_m)
    beside = _fading(abs(error_m), HERE_WHOLE * here_m, HERE_NONE * here_m) if crosses[-3] else 0.0
    bend_per_m = min(max(2.0 * (from_twice_rad - from_here_rad) / (twice_m - here_m), MIN_BEND_PER_M), MAX_BEND_PER_M)
    far_rad = near_rad - _asin(error_m / near_m)
    heading_rad = far_rad + beside * (from_here_rad - far_rad)
    straight = 0.0
    if not math.isnan(line_rad):
        expected_rad = min(max(line_rad + _asin(line_error_m / near_m), -MAX_ANGLE_RAD), MAX_ANGLE_RAD)
        straight = _fading(abs(near_rad - expected_rad), STRAIGHT_RAD, NOT_STRAIGHT_RAD)
        straight *= _fading(abs(mean_bend_per_m), STRAIGHT_PER_M, BENT_PER_M)
        error_m += straight * (line_error_m - error_m)
        heading_rad += straight * (line_rad - heading_rad)
    heading_rad = min(heading_rad, near_rad - _asin(error_m / near_m) + NOT_TOWARDS_RAD)
    slower = SLOW_MPS / max(abs(speed_mps), SLOW_MPS)
    slope_per_m = slower * kp / max(kd, 1e-6)
    wanted_rad = approach_rad(error_m, speed_mps, slope_per_m, (1.0 - straight) * mean_bend_per_m) + heading_rad
    slip_s2_per_m = SLIP_S2_PER_M + SLIP_S3_PER_M2 * abs(speed_mps)
    wanted_rad += (1.0 - straight) * beside * slip_s2_per_m * speed_mps * speed_mps * bend_per_m
    rough = min(ROUGH_KD_SHARE, slower)
    steering_rad = kd * (rough + straight * (slower - rough)) * wanted_rad
    share = turn_share(radius_m[:TURN_CIRCLES], bearing_rad, crosses, speed_mps)
    turn_rad = -math.atan(wheelbase_m / (TURN_M + TURN_S * abs(speed_mps)))
    return error_m, heading_rad, straight, steering_rad + share * min(turn_rad - steering_rad, 0.0)


def turn_share(
    radius_m: tuple[float, ...], bearing_rad: tuple[float, ...], crosses: tuple[bool, ...], speed_mps: float
) -> float:
    """Return the share of full lock, 0 to 1, with which the car has to turn away from the wall for the corners ahead.

    A circle of radius R that touches the car's straight way so that it also touches a line at the heading h (< 0) and
    the offset d from the car begins (d - R (1 - cos h)) / sin |h| ahead. The lines are the chords of the path.
    """
    turn_m, speed_mps = TURN_M + TURN_S * abs(speed_mps), abs(speed_mps)
    share, begun, x0, y0 = 0.0, False, 0.0, 0.0
    for r_m, b_rad, crossed in zip(radius_m, bearing_rad, crosses, strict=False):
        if not crossed:
            if begun:
                break
            continue
        x, y = r_m * math.cos(b_rad), r_m * math.sin(b_rad)
        chord_rad = math.atan2(y - y0, x - x0)
        if begun and -TURN_TO_RAD < chord_rad < -TURN_FROM_RAD:
            cos, sin = math.cos(chord_rad), math.sin(chord_rad)
            left_m = (cos * y - sin * x - turn_m * (1.0 - cos)) / -sin - TURN_AHEAD_S * speed_mps
            sharp = min((-chord_rad - TURN_FROM_RAD) / (TURN_WHOLE_RAD - TURN_FROM_RAD), 1.0)
            share = max(share, sharp * _fading(left_m, 0.0, TURN_RAMP_M))
        begun, x0, y0 = True, x, y
    return share


def approach_rad(error_m: float, speed_mps: float, slope_per_m: float, path_per_m: float = 0.0) -> float:
    """Return the heading to the path at which it is approached: a straight, then an arc's acos(1 - c |e|).

    path_per_m: the path's own curvature, left positive; an arc that has to turn the same way as the path has less left.
    """
    sharpest_per_m = 1.0 / (ARC_M + ARC_S * abs(speed_mps))
    against_per_m = min(math.copysign(path_per_m, error_m * path_per_m), 0.0)
    bend_per_m = max(sharpest_per_m + against_per_m, MIN_ARC_SHARE * sharpest_per_m)
    size_m = abs(error_m)
    # The arc's heading h grows by c / sin(h) per metre: the straight ends where it is no steeper than that.
    joint_rad = math.asin(min(bend_per_m / slope_per_m, 1.0)) if slope_per_m > 0 else math.inf
    wanted_rad = slope_per_m * size_m
    if wanted_rad > joint_rad:
        cos = math.cos(joint_rad) - bend_per_m * (size_m - joint_rad / slope_per_m)
        wanted_rad = math.acos(max(cos, -1.0))
    return math.copysign(min(wanted_rad, MAX_SLOPE_RAD), error_m)


def _fading(value: float, whole_below: float, none_above: float) -> float:
    return min(max((none_above - value) / (none_above - whole_below), 0.0), 1.0)


def _asin(sine: float) -> float:
    """Return the angle; beyond what a triangle allows, that of the last one that exists."""
    return math.asin(min(max(sine, -1.0), 1.0))
