"""How to stop: with all there is, with what a bend leaves, or so gently that the car still turns past.

Braking and turning share one grip (Kamm's circle), and locked wheels go straight on. A car 0.5 m from a wall and turned
20 degrees toward it at 3 m/s that turns away as sharply as it can passes on any floor from 0.5 on when it brakes with 1
to 3.5 m/s2; with all there is it hits the wall on a floor of 0.65 and less, and without braking on one of 0.5. (Tried
in the simulator; at 4 m/s nothing that was tried passes on a floor of 0.8.)
"""

import math

from runtime.command import NO_LIMIT_MPS, Verdict
from runtime.control.body import Body
from runtime.control.footprint import Contact
from runtime.control.stopping import brake_beside_turning_mps2, stopping_distance_m
from runtime.control.strip import Strip

TURNING_SHARE = 0.3
"""A bend that takes more than this of the grip is braked with what it leaves: locked wheels go straight on."""
NEEDY_SHARE = 0.7
"""A bend that takes more than this of a slippery floor's grip leaves too little for slowing down as the motor does."""
EDGE_M = 0.05
"""What reaches so little into the strip is beside the car, not before it."""


def is_beside(body: Body, found: Contact) -> bool:
    """Whether it touches only the flank."""
    return abs(found.aside_m) > body.ahead.half_width_m - EDGE_M


def turns_past(
    strip: Strip, found: Contact, steering_rad: float, *, hurries: bool, hastes: bool, begun: bool
) -> Verdict | None:
    """Return a stop beside the bend where the car turns away and gets past what it would touch with its margins.

    hurries: the distance is less than a hard stop needs. hastes: it is too fast, and its driver does not slow down;
    in a bend that needs much grip the motor must not do it for him as fast as it can. begun: it was so in the scan
    before; then it goes on through such a bend, because a motor that is told a speed again comes to it at once. None
    where that is no way past, or not needed any more.
    """
    body = strip.body
    needy = strip.needs_grip(steering_rad, strip.speed_mps, NEEDY_SHARE * body.slippery_mps2)
    if begun and not hurries:
        return _beside_bend(strip, found, steering_rad) if needy else None
    if not (hurries or (hastes and needy)) or found.aside_m * steering_rad >= 0:
        return None
    passes = strip.nose_passes(steering_rad, found.travel_m, _gentle_mps2(body))
    return _beside_bend(strip, found, steering_rad) if passes else None


def _beside_bend(strip: Strip, found: Contact, steering_rad: float) -> Verdict:
    """Brake gently, and with all that a slippery floor leaves beside the bend for what is still ahead.

    The slower the car, the less its bend needs, and that only the nose gets past is no reason to arrive there fast:
    gently all the way, it came to the edge of a corner at 1.6 m/s and touched it. From what is beside it already, no
    brake keeps it away.
    """
    body, brake_mps2 = strip.body, _gentle_mps2(strip.body)
    if 0.0 < found.travel_m < math.inf:
        bend_per_m = math.tan(steering_rad) / body.car.wheelbase_m
        brake_mps2 = max(brake_mps2, brake_beside_turning_mps2(strip.speed_mps, bend_per_m, body.slippery_mps2))
    return Verdict(0.0, NO_LIMIT_MPS, "braking: wall beside", found.travel_m, brake_mps2)


def _gentle_mps2(body: Body) -> float:
    return body.settings.gentle_share * body.slippery_mps2


def hard_stop(strip: Strip, found: Contact, reaction_s: float) -> Verdict:
    """Brake with all there is where that stops the car, also on a slippery floor, before what is straight on.

    Else a car in a bend needs its bend, because locked wheels go straight on, and brakes with what it leaves. A bend
    that takes all of the grip leaves nothing, and to turn is no stop; the gentle brake it does not feel (Pythagoras).
    """
    body, speed_mps = strip.body, strip.speed_mps
    if speed_mps * speed_mps * abs(found.curvature_per_m) > TURNING_SHARE * body.grip_mps2:
        needed_m = stopping_distance_m(speed_mps, reaction_s, body.slippery_mps2)
        if strip.straight_on(needed_m).travel_m < needed_m:
            rest_mps2 = brake_beside_turning_mps2(speed_mps, found.curvature_per_m, body.grip_mps2)
            brake_mps2 = max(rest_mps2, _gentle_mps2(body))
            return Verdict(0.0, NO_LIMIT_MPS, "braking in a bend: wall ahead", found.travel_m, brake_mps2)
    return Verdict(0.0, NO_LIMIT_MPS, "braking: wall ahead", found.travel_m)
