"""The choice among predicted outcomes, number by number: thresholds, order and what is rolled out at all."""

import math
from typing import Any

import pytest

from tests.runtime.control.safety.manoeuvre_scenes import GRIPS_MPS2, box, situation
from wallride.runtime.control.safety.emergency_manoeuvre import (
    CLEARLY_M,
    CLEARLY_MPS,
    FULL_BRAKE,
    HARDLY_MPS,
    NARROW_M,
    Manoeuvre,
    Outcome,
    best_of,
    candidates,
    choose,
    is_clearly_better,
    is_surely_better,
    never_harder,
)
from wallride.runtime.control.safety.manoeuvre_rollout import MAX_ROOM_M, TINY

WISH_RAD = 0.3
OWN = Manoeuvre(WISH_RAD, 2.0)
OTHER = Manoeuvre(-0.2, 2.0)


def outcome(manoeuvre, impact_mps, room_m=0.0):
    return Outcome(manoeuvre, impact_mps, room_m)


class Predicted:
    """A situation whose outcomes are written down; asked: what was rolled out, call by call."""

    def __init__(self, *outcomes):
        self._outcomes = {found.manoeuvre: found for found in outcomes}
        self.tried = list(self._outcomes)
        self.asked = []

    def predict(self, manoeuvres):
        self.asked.append(list(manoeuvres))
        return [self._outcomes[manoeuvre] for manoeuvre in manoeuvres]

    def best(self, kept=FULL_BRAKE):
        here: Any = self
        return best_of(here, self.tried, kept, WISH_RAD).manoeuvre


def test_what_is_tried_and_in_which_order():
    tried = candidates(0.1, (-0.4, 0.4), (8.0, 5.0), 0.2)
    brakes_mps2 = [0.7 * 5.0, 0.45 * 5.0, 0.2 * 5.0, 0.0, 0.8 * 8.0]
    assert tried[0] == FULL_BRAKE == Manoeuvre(0.0, math.inf)
    assert [each.steering_rad for each in tried[1::5]] == [0.1, 0.0, 0.4, -0.4, 0.2, -0.2]
    for first in range(1, 31, 5):
        assert [each.brake_mps2 for each in tried[first : first + 5]] == pytest.approx(brakes_mps2)
        assert len({each.steering_rad for each in tried[first : first + 5]}) == 1
    assert len(tried) == 31
    assert len(candidates(0.4, (-0.4, 0.4), (8.0, 5.0), 0.2)) == 26, "equal steering is tried once"


def test_an_outcome_is_the_worst_of_its_floors():
    assert outcome(OWN, (0.5, 2.0)).worst_mps == 2.0
    assert outcome(OWN, (2.0, 0.5)).worst_mps == 2.0
    assert outcome(OWN, (0.0, TINY)).is_free
    assert not outcome(OWN, (0.0, 1.01 * TINY)).is_free


def test_a_prediction_has_a_speed_for_each_floor_and_the_room():
    near, free = situation(box(0.3, 0.8)), situation(box(4.0, 0.8))
    hits, coasts = near.predict([FULL_BRAKE, OWN])
    assert (hits.manoeuvre, coasts.manoeuvre) == (FULL_BRAKE, OWN)
    assert len(hits.impact_mps) == len(GRIPS_MPS2)
    assert 0.0 < hits.impact_mps[0] < hits.impact_mps[1]
    assert (hits.room_m, coasts.room_m) == (0.0, 0.0)
    (stops,) = free.predict([FULL_BRAKE])
    assert (stops.impact_mps, stops.room_m) == ((0.0, 0.0), MAX_ROOM_M)


def test_a_brake_with_room_enough_is_all_that_is_rolled_out():
    enough_m = MAX_ROOM_M - CLEARLY_M
    for room_m, calls in ((enough_m + 1e-9, 1), (MAX_ROOM_M, 1), (enough_m - 1e-3, 2)):
        here = Predicted(outcome(FULL_BRAKE, (0.0, 0.0), room_m), outcome(OWN, (0.0, 0.0), room_m))
        assert here.best() == FULL_BRAKE
        assert len(here.asked) == calls
        assert here.asked[0] == [FULL_BRAKE]


def test_the_end_of_the_room_counts_as_enough(monkeypatch):
    monkeypatch.setattr("wallride.runtime.control.safety.emergency_manoeuvre.MAX_ROOM_M", 0.5)
    monkeypatch.setattr("wallride.runtime.control.safety.emergency_manoeuvre.CLEARLY_M", 0.25)
    here = Predicted(outcome(FULL_BRAKE, (0.0, 0.0), 0.25), outcome(OWN, (0.0, 0.0), 0.5))
    assert here.best() == FULL_BRAKE
    assert len(here.asked) == 1


def test_a_manoeuvre_that_was_begun_is_rolled_out_beside_a_brake_with_room():
    here = Predicted(outcome(FULL_BRAKE, (0.0, 0.0), MAX_ROOM_M), outcome(OTHER, (0.0, 0.0), MAX_ROOM_M))
    assert here.best(kept=OTHER) == OTHER
    assert here.asked == [[FULL_BRAKE], [OTHER]]


def test_a_brake_that_hits_is_compared_with_everything_and_one_that_stops_with_the_drivers_own():
    brake_hits = outcome(FULL_BRAKE, (1.0, 2.0))
    own, other = outcome(OWN, (0.0, 0.0), 0.1), outcome(OTHER, (0.0, 0.0), 0.2)
    here = Predicted(brake_hits, own, other)
    assert here.best() == OTHER
    assert here.asked == [[FULL_BRAKE], [OWN, OTHER]]
    here = Predicted(outcome(FULL_BRAKE, (TINY, 2.0)), own, other)
    assert here.best() == OWN
    assert here.asked == [[FULL_BRAKE], [OWN]]
    here = Predicted(outcome(FULL_BRAKE, (0.0, 2.0)), own, other)
    assert here.best(kept=OTHER) == OTHER, "what was begun is rolled out, too"
    assert here.asked == [[FULL_BRAKE], [OWN, OTHER]]
    here = Predicted(outcome(FULL_BRAKE, (0.0, 0.0), 0.1), own, other)
    assert here.best() == FULL_BRAKE


@pytest.mark.parametrize(("impact_mps", "is_taken"), [(TINY, False), (2 * TINY, True)])
def test_the_wheels_are_taken_only_where_the_brake_hits_something_on_the_assumed_floor(impact_mps, is_taken):
    brake, other = outcome(FULL_BRAKE, (impact_mps, 2.0)), outcome(OTHER, (0.0, 0.0), 0.2)
    assert choose([brake, other], FULL_BRAKE, WISH_RAD) is (other if is_taken else brake)


@pytest.mark.parametrize(("room_m", "is_chosen"), [(NARROW_M, True), (NARROW_M - 1e-6, False)])
def test_the_drivers_own_way_past_needs_room_where_the_brake_may_stop(room_m, is_chosen):
    brake, own = outcome(FULL_BRAKE, (0.0, 2.0)), outcome(OWN, (0.0, 0.0), room_m)
    assert choose([brake, own], FULL_BRAKE, WISH_RAD) is (own if is_chosen else brake)


def test_of_the_better_ones_the_least_impact_is_chosen_and_then_the_most_room():
    brake = outcome(FULL_BRAKE, (2.0, 3.0))
    harder, softer = outcome(OWN, (0.0, 1.0), 0.5), outcome(OTHER, (0.0, 0.5), 0.0)
    assert choose([brake, harder, softer], FULL_BRAKE, WISH_RAD) is softer
    narrow, wide = outcome(OWN, (0.0, 0.0), 0.05), outcome(OTHER, (0.0, 0.0), 0.06)
    assert choose([brake, narrow, wide], FULL_BRAKE, WISH_RAD) is wide
    first, second = outcome(OWN, (0.0, 0.04), 0.051), outcome(OTHER, (0.0, 0.0), 0.054)
    assert choose([brake, first, second], FULL_BRAKE, WISH_RAD) is first, "the same to the accuracy of the rollouts"
    assert choose([brake, second, first], FULL_BRAKE, WISH_RAD) is second


def test_a_begun_one_gives_way_to_the_brake_only_where_it_hits_clearly_harder():
    brake = outcome(FULL_BRAKE, (1.0, 2.0))
    bearable, too_hard = outcome(OTHER, (1.25, 2.25)), outcome(OTHER, (1.0, 2.35))
    assert choose([brake, bearable], OTHER, WISH_RAD) is bearable
    assert choose([brake, too_hard], OTHER, WISH_RAD) is brake
    assert choose([brake, bearable], Manoeuvre(0.1, 1.0), WISH_RAD) is brake, "what was begun is not among them"


def test_a_begun_turn_gives_way_to_a_brake_that_is_softer_in_two_scans_in_a_row():
    """By less than the margin beside a wall, noise says from scan to scan whether a turn touches it."""
    brake = outcome(FULL_BRAKE, (0.0, 1.7))
    touches, passes = outcome(OWN, (0.8, 1.9)), outcome(OWN, (0.0, 1.4))
    assert choose([brake, touches], OWN, WISH_RAD, passes) is touches
    assert choose([brake, touches], OWN, WISH_RAD, touches) is brake
    assert choose([brake, touches], OWN, WISH_RAD, outcome(OTHER, (0.0, 1.4))) is brake, "that was another turn"
    assert choose([brake, touches], OWN, WISH_RAD) is brake, "it was not begun in the scan before"


@pytest.mark.parametrize(
    ("impact_mps", "room_m"), [((0.0, 0.0), NARROW_M), ((0.8 - 1.1 * CLEARLY_MPS, 1.9 - 1.1 * CLEARLY_MPS), 0.0)]
)
def test_a_brake_that_is_surely_better_ends_a_begun_turn_at_once(impact_mps, room_m):
    brake = outcome(FULL_BRAKE, impact_mps, room_m)
    touches, passes = outcome(OWN, (0.8, 1.9)), outcome(OWN, (0.0, 0.0))
    assert choose([brake, touches], OWN, WISH_RAD, passes) is brake


def test_a_begun_turn_gives_way_to_another_only_by_more_than_noise():
    brake, turn = outcome(FULL_BRAKE, (1.4, 2.1)), outcome(OWN, (0.0, 1.9))
    narrow, wide = outcome(OTHER, (0.0, 0.0), 0.9 * NARROW_M), outcome(OTHER, (0.0, 0.0), NARROW_M)
    slower = outcome(OTHER, (0.0, 1.2))
    for other in (narrow, slower):
        assert choose([brake, turn, other], OWN, WISH_RAD) is turn
        assert choose([brake, turn, other], FULL_BRAKE, WISH_RAD) is other, "nothing was begun"
    assert choose([brake, turn, wide], OWN, WISH_RAD) is wide
    gentler = outcome(Manoeuvre(WISH_RAD, 1.0), (0.0, 1.2))
    assert choose([brake, turn, gentler], OWN, WISH_RAD) is gentler, "the same steering"


def test_a_brake_with_less_room_does_not_end_a_begun_turn():
    brake, turn = outcome(FULL_BRAKE, (0.0, 0.0), NARROW_M), outcome(OWN, (0.0, 0.0), 0.05)
    assert choose([brake, turn], OWN, WISH_RAD) is turn


def test_a_softer_turn_on_every_floor_is_surely_better():
    turn = outcome(OWN, (1.0, 2.0))
    assert is_surely_better(outcome(OTHER, (0.6, 1.6)), turn)
    assert not is_surely_better(outcome(OTHER, (0.8, 1.6)), turn)
    assert not is_surely_better(outcome(OTHER, (0.6, 1.8)), turn)


def test_harder_is_judged_on_every_floor():
    base, by_mps = outcome(FULL_BRAKE, (1.0, 2.0)), 0.5
    assert never_harder(outcome(OWN, (1.5, 2.5)), base, by_mps)
    assert not never_harder(outcome(OWN, (1.5 + 1e-9, 2.0)), base, by_mps)
    assert not never_harder(outcome(OWN, (0.0, 2.5 + 1e-9)), base, by_mps)


def test_clearly_better_is_a_clear_difference_of_impact_or_of_room():
    hits = outcome(FULL_BRAKE, (1.0, 2.0))
    assert is_clearly_better(outcome(OWN, (1.0, 2.0 - CLEARLY_MPS - 1e-9)), hits)
    assert not is_clearly_better(outcome(OWN, (0.0, 2.0 - CLEARLY_MPS)), hits)
    assert is_clearly_better(outcome(OWN, (0.0, 0.0)), hits), "free is better than any contact"
    barely = outcome(FULL_BRAKE, (0.0, HARDLY_MPS), 0.01)
    assert not is_clearly_better(outcome(OWN, (0.0, 0.0), 0.01 + CLEARLY_M), barely), "a contact that hardly is one"
    assert is_clearly_better(outcome(OWN, (0.0, 0.0), 0.011 + CLEARLY_M), barely)
    more = outcome(FULL_BRAKE, (0.0, HARDLY_MPS + 0.01))
    assert is_clearly_better(outcome(OWN, (0.0, 0.0)), more)
    assert not is_clearly_better(outcome(OWN, (0.0, 0.5)), barely)
    assert not is_clearly_better(outcome(OWN, (0.0, 0.2), 1.0), outcome(FULL_BRAKE, (0.0, 0.5)))
