"""The emergency through the guard: when it begins, how long it is kept, and when it ends."""

import math

import numpy as np
import pytest

from tests.runtime.control.safety.manoeuvre_scenes import GRIPS_MPS2, LOCK_RAD
from tests.runtime.control.safety.swept_scenes import FRONT_M, SETTINGS, Car, wall_at, world
from tests.runtime.control.scans import CAR
from tests.runtime.in_earnest import judged
from wallride.runtime.control.safety import emergency
from wallride.runtime.control.safety.footprint import Outline


def slanted(distance_m, toward_rad, sign=1):
    """A wall at the left (sign 1) so far from the rear axle, toward which the car is turned."""
    normal = np.array([math.sin(toward_rad), sign * math.cos(toward_rad)])
    along = np.array([math.cos(toward_rad), -sign * math.sin(toward_rad)])
    begin, end = distance_m * normal - 3.0 * along, distance_m * normal + 9.0 * along
    return world((*begin, *end))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("noise_m", [0.0, 0.01])
def test_turning_away_from_a_wall_that_it_passes_brakes_gently(sign, noise_m):
    """0.5 m from the wall, 20 degrees toward it, 3 m/s: a full brake hits it where the floor is worse than assumed."""
    noise = np.random.default_rng(1).normal(0.0, noise_m, 1081)
    scan = slanted(0.5, math.radians(20), sign) + noise
    away = judged(Car().look(scan, speed_mps=3.0), 1.85, -sign * LOCK_RAD)
    assert (away.reason, away.forward_mps, away.reverse_mps) == ("braking in the bend: wall ahead", 0.0, math.inf)
    assert away.brake_mps2 <= 0.7 * GRIPS_MPS2[1]
    assert away.steering_rad is None  # the driver does it himself
    # A little is not enough to pass, and toward the wall is no way past: there the wheels are taken from the driver.
    for steering_rad in (-0.03, 0.0, 0.1):
        verdict = judged(Car().look(scan, speed_mps=3.0), 1.85, sign * steering_rad)
        assert verdict.reason == "swerving: wall ahead"
        assert verdict.steering_rad == -sign * LOCK_RAD


@pytest.mark.parametrize("sign", [1, -1])
def test_a_noisy_scan_seldom_turns_the_gentle_brake_into_a_full_one(sign):
    """At 2 cm of noise the way past the wall is at times predicted too narrow."""
    reasons = []
    for seed in range(20):
        scan = slanted(0.5, math.radians(20), sign) + np.random.default_rng(seed).normal(0.0, 0.02, 1081)
        reasons.append(judged(Car().look(scan, speed_mps=3.0), 1.85, -sign * LOCK_RAD).reason)
    assert reasons.count("braking in the bend: wall ahead") >= 17
    assert set(reasons) <= {"braking in the bend: wall ahead", "braking: wall ahead"}


def test_the_guard_takes_the_wheels_where_only_a_turn_passes():
    scan = world((FRONT_M + 1.0, 0.13, FRONT_M + 1.0, 1.5))
    verdict = judged(Car().look(scan, speed_mps=4.0), 4.0, 0.0)
    assert verdict.reason == "swerving: wall ahead"
    assert verdict.steering_rad < 0.0
    assert verdict.brake_mps2 < math.inf


@pytest.mark.parametrize("wish_rad", [0.3, -0.3])
def test_a_driver_who_has_begun_to_swerve_before_a_box_is_braked_in_full(wish_rad):
    car = Car()
    far = world(wall_at(6.0))
    for wheel_rad in (0.0, 0.08 * wish_rad / 0.3, 0.16 * wish_rad / 0.3):
        car.look(far, speed_mps=3.0, wheel_rad=wheel_rad)
    stop = judged(car.look(world(wall_at(FRONT_M + 0.5, 0.4)), speed_mps=3.0, wheel_rad=wish_rad * 0.8), 3.0, wish_rad)
    assert (stop.reason, stop.brake_mps2) == ("braking: wall ahead", math.inf)


def test_a_swerve_that_comes_too_late_is_braked_although_its_arc_is_free():
    """The wheels are turned and the arc passes the box, but the body needs a moment: a scan later 5 cm are lost."""
    boxed = world((FRONT_M + 0.35, 0.05, FRONT_M + 0.35, 0.4))
    turned = np.minimum(0.0, -0.08 * np.arange(-6, 5)).clip(-0.34)

    def swerves(turned_rad):
        car = Car()
        for wheel_rad in turned_rad[:-1]:
            car.look(world(), speed_mps=2.0, wheel_rad=wheel_rad)
        return car.look(boxed, speed_mps=2.0, wheel_rad=turned_rad[-1])

    begun = swerves(turned)
    assert begun.strip.contact(-0.34, 2.0).travel_m > 1.0
    assert judged(begun, 2.0, -0.34).reason == "braking: wall ahead"
    other_side = swerves(np.append(np.full(8, 0.34), [0.1, -0.1, -0.34]))
    assert judged(other_side, 2.0, -0.34).forward_mps > 0.0  # it may turn back, as it did before
    long_ago = swerves(np.full(12, -0.34))
    assert judged(long_ago, 2.0, -0.34).forward_mps > 0.0


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
            assessment = car.look(scan, speed_mps=speed_mps, wheel_rad=wheel_rad)
        asked.clear()
        now_s = assessment.view.scan.stamp_s
        in_vain, _ = car.guard.memory.emergency.turns_in_vain(assessment.strip, begun_rad + 0.2, now_s)
        if not asked:
            skipped += 1
            assert not in_vain
            assert not judge(emergency._situation(assessment.strip, now_s), begun_rad + 0.2)
        else:
            assert ahead_m < 0.6 + speed_mps**2 / 8.0
    assert 0 < skipped < 38


def test_a_manoeuvre_goes_on_with_the_drivers_steering_when_that_changes():
    car = Car()
    scan = slanted(0.5, math.radians(20))
    assert judged(car.look(scan, speed_mps=3.0), 1.85, -0.34).steering_rad is None
    later = judged(car.look(scan, speed_mps=2.95, wheel_rad=-0.08), 1.85, -0.33)
    assert later.reason == "braking in the bend: wall ahead"
    assert later.steering_rad is None


def test_turning_past_goes_on_through_the_bend_and_ends_with_it():
    """A motor that is told a speed again comes to it as fast as it can, and takes the grip that the bend needs."""
    beside = world((-2, 0.6, 8, 0.6))

    def turned():
        car = Car()
        assert judged(car.look(slanted(0.5, math.radians(20)), speed_mps=3.0), 1.85, -0.34).brake_mps2 < 3.5
        return car

    going_on = judged(turned().look(beside, speed_mps=2.5, wheel_rad=-0.34), 1.85, -0.34)
    assert going_on.reason == "braking in the bend: wall ahead"
    assert judged(turned().look(beside, speed_mps=2.45, wheel_rad=-0.34), 1.85, -0.05).forward_mps == math.inf


def test_one_scan_gets_one_manoeuvre_however_often_it_is_asked():
    assessment = Car().look(slanted(0.5, math.radians(20)), speed_mps=3.0)
    first = judged(assessment, 1.85, -0.34)
    assert all(judged(assessment, 1.85, -0.34) == first for _ in range(3))


def test_a_manoeuvre_that_was_not_asked_for_a_while_is_none_any_more():
    """The driver backed meanwhile: the brake is not on still, so its latency is felt again."""
    scan, worst_mps = world(wall_at(FRONT_M + 0.5)), []
    for pause_s in (0.0, 0.3):
        car = Car()
        judged(car.look(scan, speed_mps=3.0), 3.0, 0.0)
        car.now_s += pause_s
        judged(car.look(scan, speed_mps=3.0), 3.0, 0.0)
        assert car.guard.memory.emergency.chosen is not None
        worst_mps.append(car.guard.memory.emergency.chosen.worst_mps)
    assert worst_mps[0] < worst_mps[1] - 0.05


def test_who_turns_away_too_fast_and_does_not_slow_down_is_slowed_gently():
    """The bend takes all of a slippery floor's grip: a motor that slows down as fast as it can would carry it out."""
    corner = world((-2.0, -1.0, 2.0, -1.0), (2.0, -1.0, 2.0, 20.0))

    def asked(wanted_mps):
        car = Car()
        for wheel_rad in np.linspace(0.15, 0.3, 12):
            assessment = car.look(corner, speed_mps=3.0, wheel_rad=wheel_rad)
        return judged(assessment, wanted_mps, 0.3)

    hasty = asked(3.0)
    assert (hasty.reason, hasty.forward_mps) == ("braking in the bend: wall ahead", 0.0)
    assert hasty.brake_mps2 == pytest.approx(SETTINGS.gentle_share * GRIPS_MPS2[1])
    slowing = asked(2.9)
    assert slowing.reason == "slower: wall beside"  # he does it himself: no stop
    gentle_bend = judged(Car().look(world((1.1, 0.16, 1.1, 0.6)), speed_mps=2.0), 2.0, -0.01)
    assert gentle_bend.reason == "slower: wall beside"  # there is grip enough for both


def test_what_is_within_the_outline_hides_nothing():
    """Dirt and the car's own parts, which more than three points show, do not make the way ahead free."""
    car = Car()
    inside = Outline(CAR.front_m, CAR.rear_m, CAR.half_width_m)
    assessment = car.look(world(wall_at(FRONT_M + 0.3)), speed_mps=3.0)
    assessment.strip.more_m = np.full(5, 0.3 + 0.05j)
    stop = judged(assessment, 3.0, 0.0)
    assert inside.holds(assessment.strip.more_m).all()
    assert stop.brake_mps2 == math.inf
    assert car.guard.memory.emergency.chosen is not None
    assert not car.guard.memory.emergency.chosen.is_free
