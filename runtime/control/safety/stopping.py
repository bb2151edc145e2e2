"""Stopping distance, and the maximum speed that allows a stop in time: the physics of the safety argument.

Distances are measured from the bumper. Sources: constant deceleration with a reaction time (as in Autoware's autonomous
emergency braking, d = v t + v^2 / 2a + offset); the friction circle for braking while turning (Kamm).
"""

import math

GRAVITY_MPS2 = 9.81


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


class SlidingSpeed:
    """Estimates the speed of the car while locked wheels report 0 and the car still slides.

    A rolling car decelerates by at most rolls_mps2; a report that falls faster comes from locking wheels. From then on
    the car is assumed to decelerate as on a slippery floor, by slides_mps2, until the wheels reach that speed again.
    (With the deceleration of a good floor the brake was released on a bad one while the car still moved at 2.5 m/s.)

    slides: whether the wheels are estimated to be locked now.
    """

    def __init__(self, rolls_mps2: float, slides_mps2: float) -> None:
        self._rolls_mps2 = rolls_mps2
        self._slides_mps2 = slides_mps2
        self._signed_mps = 0.0
        self._stamp_s = -math.inf
        self.slides = False

    def tune(self, rolls_mps2: float, slides_mps2: float) -> None:
        """Change the decelerations of the floor; the sliding state is kept."""
        self._rolls_mps2 = rolls_mps2
        self._slides_mps2 = slides_mps2

    def update(self, reported_mps: float | None, stamp_s: float) -> float:
        """Return the signed speed at this scan; None (no report) counts as locked wheels."""
        signed_mps = reported_mps or 0.0
        size_mps, last_mps = abs(signed_mps), abs(self._signed_mps)
        elapsed_s = stamp_s - self._stamp_s if stamp_s > self._stamp_s else 0.0
        self._stamp_s = stamp_s
        if self.slides or size_mps < last_mps - self._rolls_mps2 * elapsed_s:
            slowest_mps = max(0.0, last_mps - self._slides_mps2 * elapsed_s)
            self.slides = not size_mps >= slowest_mps  # NaN counts as sliding
            if self.slides:
                signed_mps = math.copysign(slowest_mps, self._signed_mps)
        self._signed_mps = signed_mps
        return signed_mps
