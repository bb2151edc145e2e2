"""Emergency manoeuvre: selection by predicted outcome when the car cannot continue as its driver commands.

A few dozen pairs of a steering angle and a deceleration are simulated (`manoeuvre_rollout`) on the assumed floor and
a slippery one, and the outline is swept along each path. Every few steps the car may lock its wheels and slide to rest;
a manoeuvre is rated by the best such end, so "turn away, then stop before the other wall" is one of them. A contact is
rated by its speed; without one, the least distance to any obstacle counts, the room.

A full brake straight on is the default. Another manoeuvre is chosen only where its impact is not harder on either floor
and it is clearly better on the worse one. A begun turn is given up for another steering, or for the brake, only where
that is better by more than the noise of a scan (`is_surely_better`), and for the brake after two scans in a row, too.
The steering is taken from the driver, human or not, only where the full brake collides on the assumed floor as well.
Where it does not, even the driver's own steering needs NARROW_M of room: begun in vain, it costs the brake its way.

Reason: stopping takes a distance of v^2 / 2a, moving aside by w about v sqrt(2 w / a). Below v = 2 sqrt(2 w a), 5.9 m/s
for a box of 0.8 m hit in its middle, no swerve is shorter than the stop, whatever the driver has just begun. Past an
edge w is small, and the swerve is shorter: a car 0.5 m from a wall and turned 20 degrees toward it at 3 m/s hits it on
a floor of 0.65 and less with full braking, and passes on any from 0.5 on when it turns and brakes gently.
"""

import math
from collections.abc import Sequence

import numpy as np

from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats, Places
from wallride.runtime.control.safety.manoeuvre_rollout import MAX_ROOM_M, TINY, RolloutStart, roll_out_all

HARDLY_MPS = 0.1
"""Accuracy of the impact speed of the rollouts."""
CLEARLY_MPS = 0.3
CLEARLY_M = 0.04
"""Minimum differences in impact speed, or in room, that count as clearly better."""
NARROW_M = 0.03
"""Less room than this is lost by the noise of a scan, or by a driver that changes its mind."""
STEERING_SHARES = (0.0, 1.0, -1.0, 0.5, -0.5)
"""Shares of full lock."""
BRAKE_SHARES = (0.7, 0.45)
"""Shares of a slippery floor's grip, the preferred one first; they leave 71 and 89 % of it for the bend."""
HARD_SHARE = 0.8
"""Share of the assumed floor's grip; on a slippery floor it locks the wheels."""


@value()
class Manoeuvre:
    """A steering angle and a deceleration; infinity is the full brake."""

    steering_rad: float
    brake_mps2: float


FULL_BRAKE = Manoeuvre(0.0, math.inf)


@value()
class Outcome:
    """Predicted outcome of a manoeuvre.

    impact_mps: speed of the contact on each floor, 0 without one. room_m: the least distance beyond the margin, of
    any floor; 0 with a contact.
    """

    manoeuvre: Manoeuvre
    impact_mps: tuple[float, ...]
    room_m: float

    @property
    def worst_mps(self) -> float:
        """Speed of the contact on the worst floor."""
        return max(self.impact_mps)

    @property
    def is_free(self) -> bool:
        """Whether nothing is hit on any floor."""
        return self.worst_mps <= TINY


@value(eq=False)
class EmergencyState:
    """Initial state of the rollouts.

    points_m: solid points around the car, (k,), base_link. grips_mps2: of the assumed floor and of the slippery one.
    past_rad, coming_rad: the wheels' angle at each step until now, and as commanded by the commands in flight.
    """

    start: RolloutStart
    points_m: Places
    grips_mps2: tuple[float, float]
    past_rad: Floats
    coming_rad: Floats

    def predict(self, manoeuvres: Sequence[Manoeuvre]) -> list[Outcome]:
        """Return the predicted outcome of each manoeuvre."""
        steering_rad = np.array([manoeuvre.steering_rad for manoeuvre in manoeuvres])
        brake_mps2 = np.array([manoeuvre.brake_mps2 for manoeuvre in manoeuvres])
        grips_mps2 = np.array(self.grips_mps2)
        figures = roll_out_all(
            self.points_m, steering_rad, brake_mps2, grips_mps2, (self.past_rad, self.coming_rad), self.start
        )
        rows = figures.reshape(len(manoeuvres), len(grips_mps2) + 1).tolist()
        return [Outcome(done, tuple(row[:-1]), row[-1]) for done, row in zip(manoeuvres, rows, strict=True)]


def best_of(
    situation: EmergencyState,
    tried: Sequence[Manoeuvre],
    kept: Manoeuvre,
    wish_rad: float,
    before: Outcome | None = None,
) -> Outcome:
    """Return the choice of `choose` among `tried`, the first of which is the full brake, with the fewest rollouts.

    No manoeuvre beats a brake with enough room, and only the driver's own steering beats a brake that is collision-free
    on the assumed floor.
    """
    (brake,) = situation.predict(tried[:1])
    if kept == FULL_BRAKE and brake.is_free and brake.room_m + CLEARLY_M >= MAX_ROOM_M:
        return brake
    others = tried[1:]
    if brake.impact_mps[0] <= TINY:
        others = [other for other in others if other.steering_rad == wish_rad or other == kept]
    return choose([brake, *situation.predict(others)], kept, wish_rad, before)


def candidates(
    wish_rad: float, ends_rad: tuple[float, float], grips_mps2: tuple[float, float], gentle_share: float
) -> list[Manoeuvre]:
    """Return the manoeuvres to try: the full brake first, then the driver's own steering, straight on, and turns.

    Of equal ones the first is chosen. ends_rad: of steering, right and left. gentle_share: share of a slippery floor's
    grip used by the gentlest brake.
    """
    grip_mps2, slippery_mps2 = grips_mps2
    brakes_mps2 = (*(share * slippery_mps2 for share in (*BRAKE_SHARES, gentle_share, 0.0)), HARD_SHARE * grip_mps2)
    steerings_rad = dict.fromkeys([wish_rad, *(abs(share) * ends_rad[share >= 0.0] for share in STEERING_SHARES)])
    return [FULL_BRAKE, *(Manoeuvre(steering, brake) for steering in steerings_rad for brake in brakes_mps2)]


def choose(outcomes: Sequence[Outcome], kept: Manoeuvre, wish_rad: float, before: Outcome | None = None) -> Outcome:
    """Return the best of outcomes, the first of which is the full brake's, by the rule of the module's docstring.

    kept: the choice of the previous scan, FULL_BRAKE without one. before: that choice's outcome as predicted there.
    wish_rad: the driver's own steering.
    """
    brake = outcomes[0]
    chosen = next((outcome for outcome in outcomes if outcome.manoeuvre == kept), brake)
    if _is_given_up(chosen, brake, before):
        chosen = brake
    takes_wheels = brake.impact_mps[0] > TINY
    better = [
        outcome
        for outcome in outcomes[1:]
        if never_harder(outcome, brake, HARDLY_MPS)
        and (takes_wheels or (outcome.manoeuvre.steering_rad == wish_rad and outcome.room_m >= NARROW_M))
        and (chosen is brake or _turns_alike(outcome, chosen) or is_surely_better(outcome, chosen))
    ]
    best = min(better, key=lambda outcome: (round(outcome.worst_mps, 1), -round(outcome.room_m, 2)), default=chosen)
    return best if is_clearly_better(best, chosen) else chosen


def _is_given_up(turn: Outcome, brake: Outcome, before: Outcome | None) -> bool:
    """Return whether a begun turn ends in the full brake: surely better now, or clearly softer two scans in a row."""
    if is_surely_better(brake, turn):
        return True
    if before is not None and _turns_alike(before, turn):
        least_mps = tuple(min(pair) for pair in zip(turn.impact_mps, before.impact_mps, strict=True))
        turn = Outcome(turn.manoeuvre, least_mps, turn.room_m)
    return not never_harder(turn, brake, CLEARLY_MPS)


def _turns_alike(one: Outcome, other: Outcome) -> bool:
    return one.manoeuvre.steering_rad == other.manoeuvre.steering_rad


def never_harder(one: Outcome, other: Outcome, by_mps: float) -> bool:
    """Return whether one's impact exceeds the other's by at most by_mps on every floor."""
    return all(a <= b + by_mps for a, b in zip(one.impact_mps, other.impact_mps, strict=True))


def is_clearly_better(one: Outcome, other: Outcome) -> bool:
    """Return whether one's impact is clearly lower, or it is free, or both are free and it has clearly more room.

    A contact below HARDLY_MPS counts as free without room: a path that passes by a centimetre does not replace a full
    brake.
    """
    if one.is_free and other.worst_mps <= HARDLY_MPS:
        return one.room_m > other.room_m + CLEARLY_M
    return one.is_free or one.worst_mps < other.worst_mps - CLEARLY_MPS


def is_surely_better(one: Outcome, other: Outcome) -> bool:
    """Return whether one is better by more than the noise of a scan: free with NARROW_M of room, or on every floor.

    Where a turn passes a wall by less than the margin of the rollouts, noise decides from scan to scan whether it
    touches, and how fast. Wheels that turn back and forth after it lose the way that the turn needs.
    """
    if not is_clearly_better(one, other):
        return False
    if one.is_free and one.room_m >= NARROW_M:
        return True
    return all(a < b - CLEARLY_MPS for a, b in zip(one.impact_mps, other.impact_mps, strict=True))
