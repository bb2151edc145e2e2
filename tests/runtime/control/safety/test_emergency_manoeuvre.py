"""The emergency manoeuvre, rule by rule: what is chosen of the rollouts."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.runtime.control.safety.manoeuvre_scenes import (
    GRIPS_MPS2,
    LOCK_RAD,
    box,
    chosen_for,
    outcomes_for,
    rolled,
    situation,
    start,
)
from tests.runtime.control.safety.swept_scenes import SETTINGS
from tests.runtime.control.scans import CAR
from wallride.runtime.control.safety.emergency_manoeuvre import (
    FULL_BRAKE,
    EmergencyState,
    Manoeuvre,
    Outcome,
    best_of,
    candidates,
    choose,
)
from wallride.runtime.control.safety.manoeuvre_rollout import distance_m


@pytest.mark.parametrize("wish_rad", [0.0, LOCK_RAD, -LOCK_RAD])
@pytest.mark.parametrize("speed_mps", [2.0, 3.0, 4.0])
@pytest.mark.parametrize("gap_m", [0.2, 0.4, 0.6, 0.8])
def test_before_a_box_across_the_way_the_answer_is_a_full_brake(speed_mps, gap_m, wish_rad):
    """Below 2 sqrt(2 w a) = 5.9 m/s no swerve is shorter than the stop, also for a driver who has begun one."""
    past_rad = np.concatenate([np.zeros(24), np.linspace(0.0, wish_rad / 2, 6)])
    found = chosen_for(box(gap_m, 0.8), wish_rad, speed_mps=speed_mps, past_rad=past_rad)
    assert found.manoeuvre == FULL_BRAKE


def edge(gap_m, overlap_m):
    """The edge of a wide box on the left that reaches so far before the car."""
    return box(gap_m, 1.0, CAR.half_width_m - overlap_m + 0.5)


def test_past_an_edge_the_swerve_wins():
    """2 cm of overlap at 4 m/s: the brake hits at 2 m/s and more, a turn away passes on either floor."""
    found = chosen_for(edge(1.0, 0.02), speed_mps=4.0)
    assert found.is_free
    assert found.manoeuvre.steering_rad < 0.0
    brake = outcomes_for(edge(1.0, 0.02), speed_mps=4.0)[0]
    assert min(brake.impact_mps) > 2.0


def test_the_wheels_are_left_to_the_driver_where_the_brake_suffices_on_the_assumed_floor():
    points_m = edge(0.8, 0.02)
    outcomes = outcomes_for(points_m)
    assert outcomes[0].impact_mps[0] == 0.0 < outcomes[0].impact_mps[1]
    assert chosen_for(points_m).manoeuvre == FULL_BRAKE
    own = chosen_for(points_m, -LOCK_RAD)
    assert own.is_free
    assert own.manoeuvre.steering_rad == -LOCK_RAD


def test_turning_away_ends_in_a_stop_before_the_other_wall():
    """A car that coasts round an edge with full lock hits nothing, because it locks its wheels before the wall."""
    edge_and_wall = np.concatenate([edge(0.8, 0.0), np.linspace(-1.0, 4.0, 300) - 0.95j])
    (coasting,) = situation(edge_and_wall).predict([Manoeuvre(-LOCK_RAD, 0.0)])
    assert coasting.is_free
    for grip_mps2 in GRIPS_MPS2:
        for_ever = rolled(-LOCK_RAD, 0.0, grip_mps2)
        assert min(distance_m(start(), state, edge_and_wall) for state in for_ever) == 0.0


def outcome(steering_rad, impact_mps, room_m=0.0):
    return Outcome(Manoeuvre(steering_rad, 1.2), impact_mps, room_m)


def test_nothing_that_hits_harder_on_either_floor_is_chosen():
    brake = Outcome(FULL_BRAKE, (1.0, 2.5), 0.0)
    assert choose([brake, outcome(0.3, (0.0, 2.9))], FULL_BRAKE, 0.3) is brake
    assert choose([brake, outcome(0.3, (1.5, 1.5))], FULL_BRAKE, 0.3) is brake
    better = outcome(0.3, (1.0, 2.0))
    assert choose([brake, better], FULL_BRAKE, 0.3) is better
    assert choose([brake, outcome(0.3, (1.0, 2.3))], FULL_BRAKE, 0.3) is brake  # not clearly


@pytest.mark.parametrize("slippery_mps", [0.07, 0.2, 0.33])
def test_a_brake_that_may_stop_is_not_given_up_for_a_narrow_way_past(slippery_mps):
    """Followers that swerved past a box with 7 mm of room hit it at 0.38 m/s, where the brake stops 6 cm before it."""
    brake = Outcome(FULL_BRAKE, (0.0, slippery_mps), 0.0)
    narrow, wide = outcome(0.3, (0.0, 0.0), 0.009), outcome(0.3, (0.0, 0.0), 0.05)
    assert choose([brake, narrow], FULL_BRAKE, 0.3) is brake
    assert choose([brake, wide], FULL_BRAKE, 0.3) is wide
    hits = Outcome(FULL_BRAKE, (0.2, 0.5), 0.0)
    assert choose([hits, narrow], FULL_BRAKE, 0.3) is narrow, "nothing is lost by it"


def test_what_was_begun_is_kept_until_something_is_clearly_better():
    brake = Outcome(FULL_BRAKE, (1.0, 2.0), 0.0)
    one, other = outcome(0.3, (0.0, 0.0), 0.02), outcome(0.2, (0.0, 0.0), 0.05)
    assert choose([brake, one, other], one.manoeuvre, 0.3) is one
    assert choose([brake, one, other], other.manoeuvre, 0.3) is other
    roomy = outcome(0.2, (0.0, 0.0), 0.07)
    assert choose([brake, one, roomy], one.manoeuvre, 0.3) is roomy
    # a kept one that turns out a little worse than the brake is no reason to lock the wheels; much worse is
    assert choose([brake, (kept := outcome(0.3, (1.0, 2.2)))], kept.manoeuvre, 0.3) is kept
    assert choose([brake, outcome(0.3, (1.0, 2.4))], kept.manoeuvre, 0.3) is brake


@given(
    gap_m=st.floats(0.05, 1.5),
    left_m=st.floats(-0.7, 0.7),
    speed_mps=st.floats(0.3, 4.0),
    wish_rad=st.sampled_from([0.0, 0.1, LOCK_RAD, -LOCK_RAD]),
    keeps=st.integers(0, 30),
)
@example(gap_m=1.04, left_m=0.47, speed_mps=3.1, wish_rad=-LOCK_RAD, keeps=0)  # the brake stops, the turn has room
@settings(max_examples=60, deadline=None)
def test_what_cannot_be_chosen_is_not_rolled_out(gap_m, left_m, speed_mps, wish_rad, keeps):
    rolled_out = []

    class Counted(EmergencyState):
        def predict(self, manoeuvres):
            rolled_out.extend(manoeuvres)
            return super().predict(manoeuvres)

    here = situation(box(gap_m, 0.6, left_m), speed_mps=speed_mps)
    tried = candidates(wish_rad, (-LOCK_RAD, LOCK_RAD), GRIPS_MPS2, SETTINGS.gentle_share)
    kept = tried[keeps % len(tried)]
    counted = Counted(here.start, here.points_m, here.grips_mps2, here.past_rad, here.coming_rad)
    found = best_of(counted, tried, kept, wish_rad)
    outcomes = here.predict(tried)
    assert found == choose(outcomes, kept, wish_rad)
    assert len(rolled_out) <= (31 if outcomes[0].impact_mps[0] > 0.0 else 7)


def test_with_a_slow_lidar_a_turn_is_braked_a_scan_later():
    """The last moment for the brake is not between two scans."""
    gentle, ahead_m = Manoeuvre(0.0, 2.0), 0.7
    for waits_s, is_free in ((0.0, True), (0.14, False)):
        brake, slowed = situation(box(ahead_m, 4.0), speed_mps=2.0, waits_s=waits_s).predict([FULL_BRAKE, gentle])
        assert brake.is_free
        assert slowed.is_free == is_free
