"""Stopping distance, and the maximum speed that allows a stop in time: the physics of the safety argument.

Distances are measured from the bumper. Sources: constant deceleration with a reaction time (as in Autoware's autonomous
emergency braking, d = v t + v^2 / 2a + offset); the friction circle for braking while turning (Kamm).
"""

import math


def stopping_distance_m(speed_mps: float, reaction_s: float, brake_mps2: float) -> float:
    """Return v t + v^2 / (2 a)."""
    return speed_mps * reaction_s + speed_mps * speed_mps / (2 * brake_mps2)


def speed_to_stop_within_mps(distance_m: float, reaction_s: float, brake_mps2: float) -> float:
    """Return the maximum speed whose stopping distance is distance_m (0 where there is none); the inverse of above.

    v = -a t + sqrt((a t)^2 + 2 a s)
    """
    if distance_m <= 0:
        return 0.0
    reach_mps = brake_mps2 * reaction_s
    return math.sqrt(reach_mps * reach_mps + 2 * brake_mps2 * distance_m) - reach_mps


def brake_beside_turning_mps2(speed_mps: float, curvature_per_m: float, grip_mps2: float) -> float:
    """Return the braking that the friction circle leaves in a bend: sqrt(grip^2 - (v^2 k)^2), 0 when it is used up."""
    aside_mps2 = speed_mps * speed_mps * curvature_per_m
    return math.sqrt(max(0.0, grip_mps2 * grip_mps2 - aside_mps2 * aside_mps2))
