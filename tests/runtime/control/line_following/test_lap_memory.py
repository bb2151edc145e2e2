"""Laps and their errors, and the speed of the next one."""

import math

import pytest

from wallride.runtime.control.line_following.lap_memory import HELD_SCANS, BuildUp, HeldBack, LapMemory

STEP_S = 0.025


def test_a_lap_is_counted_where_it_was_begun_with_its_errors():
    laps = LapMemory(10.0)
    done = [laps.take(STEP_S * k, (4.0 + 0.1 * k) % 10.0, 0.1 if k % 2 else -0.1) for k in range(250)]
    assert [k for k, one in enumerate(done) if one] == [100, 200]
    assert laps.last.laps == 2
    assert laps.last.time_s == pytest.approx(100 * STEP_S)
    assert laps.since_s == pytest.approx(200 * STEP_S), "the third lap begins"
    assert (laps.last.rms_m, laps.last.p99_m, laps.last.largest_m) == pytest.approx((0.1, 0.1, 0.1))


def test_the_best_lap_stays_the_best():
    laps, at_s = LapMemory(10.0), 0.0
    for steps in (100, 80, 90):
        for k in range(steps):
            laps.take(at_s + STEP_S * k, 10.0 * k / steps, 0.0)
        at_s += STEP_S * steps
    laps.take(at_s, 0.0, 0.0)
    assert laps.last.laps == 3
    assert laps.last.time_s == pytest.approx(90 * STEP_S)
    assert laps.last.best_s == pytest.approx(80 * STEP_S)


def test_a_lap_has_three_sectors_of_equal_way_from_where_it_began():
    laps, at_s, way_m = LapMemory(30.0), 0.0, 7.0
    assert laps.last.sectors_s == ()
    for step_m, scans in ((0.2, 50), (0.1, 100), (0.4, 25)):
        for _ in range(scans):
            laps.take(at_s, way_m % 30.0, 0.0)
            at_s, way_m = at_s + STEP_S, way_m + step_m
    assert laps.take(at_s, way_m % 30.0, 0.0)
    assert laps.last.sectors_s == pytest.approx((50 * STEP_S, 100 * STEP_S, 25 * STEP_S), abs=1.5 * STEP_S)
    assert sum(laps.last.sectors_s) == pytest.approx(laps.last.time_s)


def test_sectors_begin_anew_with_each_lap_and_with_one_that_was_broken_off():
    laps = LapMemory(10.0)
    for k in range(50):
        laps.take(STEP_S * k, 0.1 * k, 0.0)
    laps.begin()
    for k in range(50, 251):
        laps.take(STEP_S * k, (0.1 * k) % 10.0, 0.0)
    assert laps.last.laps == 2
    assert laps.last.sectors_s == pytest.approx((100 * STEP_S / 3,) * 3, abs=1.5 * STEP_S)


def test_a_car_that_stands_beside_its_line_adds_no_errors():
    laps = LapMemory(10.0)
    ways_m = [0.0] * 500 + [0.1 * k for k in range(110)]
    assert any(laps.take(STEP_S * k, way_m % 10.0, 0.1 if way_m else 0.5) for k, way_m in enumerate(ways_m))
    assert laps.last.rms_m == pytest.approx(0.1)


def test_a_lap_that_was_broken_off_does_not_count():
    laps = LapMemory(10.0)
    assert not any(laps.take(STEP_S * k, 0.1 * k, 0.0) for k in range(90))
    laps.begin()
    assert not any(laps.take(STEP_S * k, (0.1 * k) % 10.0, 0.0) for k in range(90, 180))
    assert math.isnan(laps.last.rms_m)


def test_the_speed_rises_by_laps_and_falls_when_held_back():
    share = BuildUp(0.6, 0.2)
    for _ in range(3):
        share.lap_done()
    assert share.share == 1.0
    share.slower()
    assert share.share == pytest.approx(0.8)
    share.lap_done()
    assert share.share == pytest.approx(0.8), "the lap in which it was held back"
    share.lap_done()
    assert share.share == 1.0
    for _ in range(5):
        share.slower()
    assert share.share == 0.6
    share.tune(0.9, 0.1)
    assert share.share == 0.9


def test_the_grip_bounds_the_share_and_takes_nothing_of_what_the_laps_have_reached():
    share = BuildUp(0.6, 0.2)
    share.bound(0.5)
    assert share.share == 0.5
    for _ in range(3):
        share.lap_done()
    share.bound(math.inf)
    assert share.share == 1.0


def test_held_back_at_the_bound_of_the_grip_the_car_is_slower_than_there():
    share = BuildUp(0.4, 0.2)
    for _ in range(3):
        share.lap_done()
    share.bound(0.8)
    share.slower()
    assert share.share == pytest.approx(0.6)


def laps_of(share, laps, fails_at):
    """Return the laps, by number, in which a car that cannot drive faster than a share of the line is held back."""
    held = []
    for lap in range(laps):
        if share.share > fails_at:
            held.append(lap)
            share.slower()
        share.lap_done()
    return held


def test_a_line_too_fast_for_the_floor_holds_the_car_back_twice_and_then_seldom():
    assert laps_of(BuildUp(0.6, 0.2), 30, fails_at=0.97) == [2, 4, 14, 24]


def test_who_holds_the_car_back_once_or_in_a_slow_lap_costs_no_later_lap():
    share = BuildUp(0.6, 0.2)
    for laps in (4, 2):
        share.slower()
        for _ in range(laps):
            share.lap_done()
        assert share.share == 1.0


def told(held, *, asked_mps, drives, scans, begin=0):
    """Return at which scans the car counts as held back; drives: its speed by the scan."""
    found = []
    for k in range(begin, begin + scans):
        held.asks(asked_mps)
        if held.tells(drives(k), STEP_S):
            found.append(k)
    return found


def test_a_car_that_obeys_with_its_lag_is_not_held_back():
    held, speed = HeldBack(4.0), [0.0]

    def obeys(k):
        speed[0] += min(6.0 - speed[0], 3.6 * STEP_S) if k > 4 else 0.0
        return speed[0]

    assert told(held, asked_mps=6.0, drives=obeys, scans=120) == []
    assert told(held, asked_mps=1.0, drives=lambda k: max(1.0, 6.0 - 0.125 * (k - 120)), scans=80, begin=120) == []


def test_a_stop_of_safety_is_told_once():
    held = HeldBack(4.0)
    told(held, asked_mps=5.0, drives=lambda k: min(5.0, 3.6 * STEP_S * k), scans=100)
    stops = told(held, asked_mps=5.0, drives=lambda k: max(0.0, 5.0 - 7.0 * STEP_S * (k - 100)), scans=60, begin=100)
    assert len(stops) == 1
    assert HELD_SCANS <= stops[0] - 100 < 20


def test_a_long_stop_is_one_and_the_next_one_counts_after_a_free_way():
    held, speed = HeldBack(4.0), [5.0]

    def waits(k):
        speed[0] = max(0.0, speed[0] - 7.0 * STEP_S) if k < 900 else min(5.0, speed[0] + 3.6 * STEP_S)
        return speed[0]

    told(held, asked_mps=5.0, drives=lambda k: min(5.0, 3.6 * STEP_S * k), scans=100)
    assert len(told(held, asked_mps=5.0, drives=waits, scans=1000, begin=100)) == 1
    again = told(held, asked_mps=5.0, drives=lambda k: max(0.0, 5.0 - 7.0 * STEP_S * (k - 1100)), scans=60, begin=1100)
    assert len(again) == 1
