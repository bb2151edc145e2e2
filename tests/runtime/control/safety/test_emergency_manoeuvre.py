"""The emergency manoeuvre, rule by rule: what the rollouts foresee, what is chosen of it, and how long it is kept."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from runtime.control.safety import emergency
from runtime.control.safety.emergency_manoeuvre import (
    FULL_BRAKE,
    EmergencyState,
    Manoeuvre,
    Outcome,
    best_of,
    candidates,
    choose,
)
from runtime.control.safety.footprint import Outline
from runtime.control.safety.manoeuvre_rollout import STEP_S, RolloutStart, distance_m, latency_path, roll_out, slide
from runtime.control.safety.stopping import GRAVITY_MPS2
from tests.runtime.control.safety.swept_scenes import CAR, FRONT_M, SETTINGS, Car, wall_at, world

GRIPS_MPS2 = 0.8 * GRAVITY_MPS2, 0.5 * GRAVITY_MPS2
NO_PAST = np.zeros(30)
LOCK_RAD = CAR.max_steering_rad


def start(speed_mps=3.0, braked_mps2=0.0, latency_s=0.05):
    return RolloutStart(
        speed_mps, braked_mps2, latency_s, CAR.steering_rate_radps, CAR.wheelbase_m, SETTINGS.cornering_per_rad,
        CAR.front_m, CAR.rear_m, CAR.half_width_m,
    )  # fmt: skip


def rolled(steering_rad, brake_mps2, grip_mps2=GRIPS_MPS2[0], past_rad=NO_PAST, **how):
    begun = latency_path(car := start(**how), past_rad.tolist(), [], grip_mps2)
    return list(roll_out(car, begun, steering_rad, brake_mps2, grip_mps2))


def box(ahead_m, width_m, left_m=0.0):
    """Points on the near face of a box, so far ahead of the bumper."""
    return CAR.front_m + ahead_m + 1j * (left_m + np.linspace(-width_m / 2, width_m / 2, 60))


def situation(points_m, past_rad=NO_PAST, **how):
    return EmergencyState(start(**how), points_m, GRIPS_MPS2, past_rad, np.full(5, past_rad[-1]))


def outcomes_for(points_m, wish_rad=0.0, **how):
    return situation(points_m, **how).predict(candidates(wish_rad, LOCK_RAD, GRIPS_MPS2, SETTINGS.gentle_share))


def chosen_for(points_m, wish_rad=0.0, kept=FULL_BRAKE, **how):
    return choose(outcomes_for(points_m, wish_rad, **how), kept, wish_rad)


# --- what the rollouts foresee


@pytest.mark.parametrize("grip_mps2", GRIPS_MPS2)
@pytest.mark.parametrize("brake_mps2", [0.0, 1.2, 3.0, 4.5])
def test_braking_and_turning_share_one_grip(grip_mps2, brake_mps2):
    """Kamm's circle: at the limit the path bends by what the brake leaves, v r <= sqrt(G^2 - b^2)."""
    path = rolled(LOCK_RAD, brake_mps2, grip_mps2, speed_mps=4.0)
    turns_mps2 = [
        state.speed_mps * (later.course_rad - state.course_rad) / STEP_S
        for state, later in pairwise(path)
        if later.speed_mps > 1.5
    ]
    left_mps2 = math.sqrt(grip_mps2**2 - brake_mps2**2)
    assert max(turns_mps2) <= 1.02 * left_mps2
    assert max(turns_mps2) > 0.6 * left_mps2
    slowed_mps = path[5].speed_mps - path[30].speed_mps
    assert slowed_mps >= 0.99 * brake_mps2 * 25 * STEP_S


def test_a_brake_of_the_whole_grip_locks_the_wheels_straight_on():
    for brake_mps2 in (GRIPS_MPS2[1], 8.0, math.inf):
        path = rolled(LOCK_RAD, brake_mps2, GRIPS_MPS2[1])
        assert path[-1].middle_m.imag == 0.0
        stopped_m = path[-1].middle_m.real - CAR.wheelbase_m / 2
        assert stopped_m == pytest.approx(3.0 * 0.05 + 9.0 / (2 * GRIPS_MPS2[1]), abs=0.02)


def test_locked_wheels_go_on_along_the_course_and_the_car_turns_a_little_more():
    past_rad = np.full(30, 0.2)
    path = rolled(0.2, math.inf, past_rad=past_rad)
    begun = path[6]
    assert begun.yaw_radps > 1.0
    assert path[-1].course_rad == begun.course_rad
    assert begun.heading_rad < path[-1].heading_rad < begun.heading_rad + 0.4


def test_the_wheels_turn_as_fast_as_the_servo_and_not_before_the_latency():
    late, soon = (rolled(LOCK_RAD, 0.0, latency_s=latency_s) for latency_s in (0.2, 0.05))
    assert late[20].heading_rad == 0.0 < soon[20].heading_rad
    assert soon[7].yaw_radps < 0.5 * soon[16].yaw_radps


def test_the_brake_that_is_on_already_goes_on_for_the_latency():
    assert rolled(0.0, 0.0, braked_mps2=4.0)[5].speed_mps == pytest.approx(3.0 - 4.0 * 0.05)
    assert rolled(0.0, 0.0)[5].speed_mps == 3.0


def test_the_past_is_felt():
    """A car whose wheels have been turned for 0.1 s rotates already; one whose wheels turn now does not yet."""
    turned = rolled(0.0, 0.0, past_rad=np.concatenate([np.zeros(20), np.full(10, 0.3)]))
    assert turned[0].yaw_radps > 1.0
    assert rolled(0.0, 0.0)[0].yaw_radps == 0.0


@pytest.mark.parametrize("speed_mps", [0.5, 1.0, 2.0])
def test_a_slow_car_turns_on_the_circle_of_its_wheels(speed_mps):
    path = rolled(LOCK_RAD, 0.0, past_rad=np.full(30, LOCK_RAD), speed_mps=speed_mps)
    turned_rad = path[60].heading_rad - path[10].heading_rad
    way_m = sum(state.speed_mps for state in path[10:60]) * STEP_S
    assert turned_rad / way_m == pytest.approx(math.tan(LOCK_RAD) / CAR.wheelbase_m, rel=0.15)


@pytest.mark.parametrize("gap_m", [0.1, 0.3, 0.7, 2.0])
def test_a_slide_hits_with_what_the_floor_leaves_of_the_speed(gap_m):
    begins = rolled(0.0, math.inf)[0]
    impact_mps, room_m = slide(start(), begins, box(gap_m, 0.6), GRIPS_MPS2[0], 0.04)
    left = 9.0 - 2 * GRIPS_MPS2[0] * (gap_m - 0.04)
    assert impact_mps == pytest.approx(math.sqrt(max(0.0, left)))
    assert (room_m == 0.0) == (impact_mps > 0.0)
    assert slide(start(), begins, box(0.3, 0.3, 0.6), GRIPS_MPS2[0], 0.04)[0] == 0.0  # beside its way


def test_a_sliding_car_is_met_at_its_corner_where_it_slides_aslant():
    aslant = rolled(0.0, 0.0)[0]._replace(course_rad=-0.3)
    beside = box(0.2, 0.1, -0.3)
    assert slide(start(), aslant, beside, GRIPS_MPS2[0], 0.0)[0] > 1.5
    assert slide(start(), aslant._replace(course_rad=0.3), beside, GRIPS_MPS2[0], 0.0)[0] == 0.0


def test_the_distance_is_the_third_nearest_points_from_the_outline():
    here = rolled(0.0, 0.0)[0]
    points_m = np.array([0.72 + 0j, 0.62 + 0.1j, 0.55 - 0.1j, 0.5 + 0j])
    assert distance_m(start(), here, points_m) == pytest.approx(0.62 - CAR.front_m)
    assert distance_m(start(), here, points_m[:2]) == math.inf
    corner = np.full(3, CAR.front_m + 0.03 + 1j * (CAR.half_width_m + 0.04))
    assert distance_m(start(), here, corner) == pytest.approx(0.05)


def test_what_is_nearer_than_the_margin_already_is_no_contact_whatever_the_car_does():
    beside = np.linspace(-1.0, 3.0, 200) + 1j * (CAR.half_width_m + 0.03)
    assert outcomes_for(beside)[0].is_free
    toward = situation(beside).predict([Manoeuvre(LOCK_RAD, 0.0), Manoeuvre(-LOCK_RAD, 0.0)])
    assert not toward[0].is_free
    assert toward[1].is_free


# --- what is chosen


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


def outcome(steering_rad, impact_mps, room_m=0.0, brake_mps2=1.2):
    return Outcome(Manoeuvre(steering_rad, brake_mps2), impact_mps, room_m)


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


def test_of_two_that_hit_nothing_the_one_with_clearly_more_room_is_chosen():
    brake = Outcome(FULL_BRAKE, (0.5, 1.0), 0.0)
    narrow, wide = outcome(0.3, (0.0, 0.0), 0.01), outcome(0.3, (0.0, 0.0), 0.09, brake_mps2=3.0)
    assert choose([brake, narrow, wide], FULL_BRAKE, 0.3) is wide


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
    tried = candidates(wish_rad, LOCK_RAD, GRIPS_MPS2, SETTINGS.gentle_share)
    kept = tried[keeps % len(tried)]
    counted = Counted(here.start, here.points_m, here.grips_mps2, here.past_rad, here.coming_rad)
    found = best_of(counted, tried, kept, wish_rad)
    outcomes = here.predict(tried)
    assert found == choose(outcomes, kept, wish_rad)
    assert len(rolled_out) <= (31 if outcomes[0].impact_mps[0] > 0.0 else 7)


# --- through the guard


def slanted(distance_m, toward_rad, sign=1):
    """A wall at the left (sign 1) so far from the rear axle, toward which the car is turned."""
    normal = np.array([math.sin(toward_rad), sign * math.cos(toward_rad)])
    along = np.array([math.cos(toward_rad), -sign * math.sin(toward_rad)])
    begin, end = distance_m * normal - 3.0 * along, distance_m * normal + 9.0 * along
    return world((*begin, *end))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("noise_m", [0.0, 0.02])
def test_turning_away_from_a_wall_that_it_passes_brakes_gently(sign, noise_m):
    """0.5 m from the wall, 20 degrees toward it, 3 m/s: a full brake hits it where the floor is worse than assumed."""
    noise = np.random.default_rng(1).normal(0.0, noise_m, 1081)
    scan = slanted(0.5, math.radians(20), sign) + noise
    away = Car().look(scan, speed_mps=3.0).limit(1.85, -sign * LOCK_RAD)
    assert (away.reason, away.forward_mps, away.reverse_mps) == ("braking in the bend: wall ahead", 0.0, math.inf)
    assert away.brake_mps2 <= 0.7 * GRIPS_MPS2[1]
    assert away.steering_rad is None  # the driver does it himself
    # A little is not enough to pass, and toward the wall is no way past: there the wheels are taken from the driver.
    for steering_rad in (-0.03, 0.0, 0.1):
        verdict = Car().look(scan, speed_mps=3.0).limit(1.85, sign * steering_rad)
        assert verdict.reason == "swerving: wall ahead"
        assert verdict.steering_rad == -sign * LOCK_RAD


def test_the_guard_takes_the_wheels_where_only_a_turn_passes():
    scan = world((FRONT_M + 1.0, 0.13, FRONT_M + 1.0, 1.5))
    verdict = Car().look(scan, speed_mps=4.0).limit(4.0, 0.0)
    assert verdict.reason == "swerving: wall ahead"
    assert verdict.steering_rad < 0.0
    assert verdict.brake_mps2 < math.inf


@pytest.mark.parametrize("wish_rad", [0.3, -0.3])
def test_a_driver_who_has_begun_to_swerve_before_a_box_is_braked_in_full(wish_rad):
    car = Car()
    far = world(wall_at(6.0))
    for wheel_rad in (0.0, 0.08 * wish_rad / 0.3, 0.16 * wish_rad / 0.3):
        car.look(far, speed_mps=3.0, wheel_rad=wheel_rad)
    stop = car.look(world(wall_at(FRONT_M + 0.5, 0.4)), speed_mps=3.0, wheel_rad=wish_rad * 0.8).limit(3.0, wish_rad)
    assert (stop.reason, stop.brake_mps2) == ("braking: wall ahead", math.inf)


def test_a_swerve_that_comes_too_late_is_braked_although_its_arc_is_free():
    """The wheels are turned and the arc passes the box, but the body needs a moment: a scan later 5 cm are lost."""
    boxed = world((FRONT_M + 0.35, 0.03, FRONT_M + 0.35, 0.4))
    turned = np.minimum(0.0, -0.08 * np.arange(-6, 5)).clip(-0.34)

    def swerves(turned_rad):
        car = Car()
        for wheel_rad in turned_rad[:-1]:
            car.look(world(), speed_mps=2.0, wheel_rad=wheel_rad)
        return car.look(boxed, speed_mps=2.0, wheel_rad=turned_rad[-1])

    begun = swerves(turned)
    assert begun.strip.contact(-0.34, 2.0).travel_m > 1.0
    assert begun.limit(2.0, -0.34).reason == "braking: wall ahead"
    other_side = swerves(np.append(np.full(8, 0.34), [0.1, -0.1, -0.34]))
    assert other_side.limit(2.0, -0.34).forward_mps > 0.0  # it may turn back, as it did before
    long_ago = swerves(np.full(12, -0.34))
    assert long_ago.limit(2.0, -0.34).forward_mps > 0.0


@pytest.mark.parametrize("begun_rad", [0.0, 0.1, 0.25])
@pytest.mark.parametrize("speed_mps", [1.0, 2.0, 3.0])
def test_what_stops_a_scan_later_is_not_rolled_out_and_would_not_be_braked(monkeypatch, speed_mps, begun_rad):
    """Walls come nearer: as long as nothing is rolled out the rollouts would not brake, and near walls are rolled."""
    asked = []
    judge = emergency._is_last_moment

    def judged(*given_):
        asked.append(given_)
        return judge(*given_)

    monkeypatch.setattr(emergency, "_is_last_moment", judged)
    skipped = 0
    for ahead_m in np.arange(0.2, 4.0, 0.1):
        car, scan = (
            Car(),
            np.minimum(world(wall_at(FRONT_M + ahead_m)), world((-3.0, ahead_m + 0.4, 9.0, ahead_m + 0.4))),
        )
        for wheel_rad in np.linspace(0.0, begun_rad, 6):
            outlook = car.look(scan, speed_mps=speed_mps, wheel_rad=wheel_rad)
        asked.clear()
        now_s = outlook.view.scan.stamp_s
        in_vain = car.guard.emergency.turns_in_vain(outlook.strip, begun_rad + 0.2, now_s)
        if not asked:
            skipped += 1
            assert not in_vain
            assert not judge(car.guard.emergency._situation(outlook.strip, now_s), begun_rad + 0.2)
        else:
            assert ahead_m < 0.6 + speed_mps**2 / 8.0
    assert 0 < skipped < 38


def test_a_manoeuvre_goes_on_with_the_drivers_steering_when_that_changes():
    car = Car()
    scan = slanted(0.5, math.radians(20))
    assert car.look(scan, speed_mps=3.0).limit(1.85, -0.34).steering_rad is None
    later = car.look(scan, speed_mps=2.95, wheel_rad=-0.08).limit(1.85, -0.33)
    assert later.reason == "braking in the bend: wall ahead"
    assert later.steering_rad is None


def test_turning_past_goes_on_through_the_bend_and_ends_with_it():
    """A motor that is told a speed again comes to it as fast as it can, and takes the grip that the bend needs."""
    beside = world((-2, 0.6, 8, 0.6))

    def turned():
        car = Car()
        assert car.look(slanted(0.5, math.radians(20)), speed_mps=3.0).limit(1.85, -0.34).brake_mps2 < 3.5
        return car

    going_on = turned().look(beside, speed_mps=2.5, wheel_rad=-0.34).limit(1.85, -0.34)
    assert going_on.reason == "braking in the bend: wall ahead"
    assert turned().look(beside, speed_mps=2.45, wheel_rad=-0.34).limit(1.85, -0.05).forward_mps == math.inf


def test_one_scan_gets_one_manoeuvre_however_often_it_is_asked():
    outlook = Car().look(slanted(0.5, math.radians(20)), speed_mps=3.0)
    first = outlook.limit(1.85, -0.34)
    assert all(outlook.limit(1.85, -0.34) == first for _ in range(3))


def test_a_manoeuvre_that_was_not_asked_for_a_while_is_none_any_more():
    """The driver backed meanwhile: the brake is not on still, so its latency is felt again."""
    scan, worst_mps = world(wall_at(FRONT_M + 0.5)), []
    for pause_s in (0.0, 0.3):
        car = Car()
        car.look(scan, speed_mps=3.0).limit(3.0, 0.0)
        car.now_s += pause_s
        car.look(scan, speed_mps=3.0).limit(3.0, 0.0)
        assert car.guard.emergency.chosen is not None
        worst_mps.append(car.guard.emergency.chosen.worst_mps)
    assert worst_mps[0] < worst_mps[1] - 0.05


def test_who_turns_away_too_fast_and_does_not_slow_down_is_slowed_gently():
    """The bend takes all of a slippery floor's grip: a motor that slows down as fast as it can would carry it out."""
    corner = world((-2.0, -1.0, 2.0, -1.0), (2.0, -1.0, 2.0, 20.0))

    def asked(wanted_mps):
        car = Car()
        for wheel_rad in np.linspace(0.15, 0.3, 12):
            outlook = car.look(corner, speed_mps=3.0, wheel_rad=wheel_rad)
        return outlook.limit(wanted_mps, 0.3)

    hasty = asked(3.0)
    assert (hasty.reason, hasty.forward_mps) == ("braking in the bend: wall ahead", 0.0)
    assert hasty.brake_mps2 == pytest.approx(SETTINGS.gentle_share * GRIPS_MPS2[1])
    slowing = asked(2.9)
    assert slowing.reason == "slower: wall beside"  # he does it himself: no stop
    gentle_bend = Car().look(world((1.1, 0.16, 1.1, 0.6)), speed_mps=2.0).limit(2.0, -0.01)
    assert gentle_bend.reason == "slower: wall beside"  # there is grip enough for both


def test_what_is_within_the_outline_hides_nothing():
    """Dirt and the car's own parts, which more than three points show, do not make the way ahead free."""
    car = Car()
    inside = Outline(CAR.front_m, CAR.rear_m, CAR.half_width_m)
    outlook = car.look(world(wall_at(FRONT_M + 0.3)), speed_mps=3.0)
    outlook.strip.more_m = np.full(5, 0.3 + 0.05j)
    stop = outlook.limit(3.0, 0.0)
    assert inside.holds(outlook.strip.more_m).all()
    assert stop.brake_mps2 == math.inf
    assert car.guard.emergency.chosen is not None
    assert not car.guard.emergency.chosen.is_free
