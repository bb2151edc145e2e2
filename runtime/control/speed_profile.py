"""How fast the path ahead may be driven: lateral grip at each point, and braking in time for it.

v <= sqrt(a_lat / |k|)        now (k of the steering about to be sent) and at each point of the ball's path
v(s)^2 <= v_point^2 + 2 a_brake (s - 0.3 - 0.06 v)
"""

import math

import numpy as np

from runtime.control.ball_path import BallPath

GRAVITY_MPS2 = 9.81
LATERAL_SHARE = 0.75
BRAKE_SHARE = 0.6
"""Of mu g; together within the friction circle (0.75^2 + 0.6^2 < 1)."""
SHARPEST_PER_M = 0.9
"""The path has kinks; the car rounds them no tighter than this."""
SPAN = 2
"""Chords between the two headings whose difference is a point's curvature: over less way, noise bends the path."""
MARGIN_M = 0.3
REACTION_S = 0.06


def speed_limit_mps(steering_rad: float, wheelbase_m: float, assumed_mu: float) -> float:
    """Return the speed at which this steering needs all the lateral grip that is counted on."""
    curvature = abs(math.tan(steering_rad)) / wheelbase_m
    return math.sqrt(LATERAL_SHARE * assumed_mu * GRAVITY_MPS2 / max(curvature, 1e-6))


def profile_mps(path: BallPath, speed_mps: float, assumed_mu: float) -> float:
    """Return the highest speed now from which every point of the path can still be driven.

    path: circles in growing order; it ends at the first circle that the wall does not meet, and beyond the end a
    corner of the sharpest curvature is assumed.
    """
    lateral = LATERAL_SHARE * assumed_mu * GRAVITY_MPS2
    brake = BRAKE_SHARE * assumed_mu * GRAVITY_MPS2
    # Nearer circles than the first crossing lie wholly inside or outside of D: the way to the path, not the path.
    begin = int(path.crosses.argmax())
    ends = np.flatnonzero(~path.meets[begin:])
    end = begin + int(ends[0]) if ends.size else path.meets.size
    if not path.crosses[begin]:
        end = begin
    radius_m, bearing_rad = path.radius_m[begin:end], path.bearing_rad[begin:end]
    x_m, y_m = radius_m * np.cos(bearing_rad), radius_m * np.sin(bearing_rad)
    dx, dy = x_m[1:] - x_m[:-1], y_m[1:] - y_m[:-1]
    heading = np.arctan2(dy, dx)
    way = radius_m[:1].sum() + np.cumsum(np.sqrt(dx * dx + dy * dy))
    turn = np.abs((heading[SPAN:] - heading[:-SPAN] + math.pi) % math.tau - math.pi)
    # At each inner point its own curvature; at the end of what is seen, a corner.
    curvature = np.append(turn / np.maximum(way[SPAN:] - way[:-SPAN], 1e-3), SHARPEST_PER_M)
    curvature = np.minimum(curvature, SHARPEST_PER_M)
    way_m = np.append(way[:-SPAN], way[-1] if way.size else 0.0)
    free_m = np.maximum(way_m - MARGIN_M - REACTION_S * abs(speed_mps), 0.0)
    square = lateral / np.maximum(curvature, 1e-3) + 2 * brake * free_m
    return math.sqrt(float(square.min()))
