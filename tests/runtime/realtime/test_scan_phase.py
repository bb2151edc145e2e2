"""Nothing is begun when a scan is due, and nobody waits for a scan that does not come."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.runtime.realtime.scan_phase import AFTER_S, MAX_BEFORE_S, SPARE_S, ScanPhase

PERIOD_S = 0.025
LAST_S = 1.0


def steady(period_s=PERIOD_S, count=5):
    scan_phase = ScanPhase()
    for i in range(count):
        scan_phase.arrived(LAST_S - (count - 1 - i) * period_s)
    return scan_phase


def test_the_beat_is_known_when_two_gaps_agree():
    scan_phase = ScanPhase()
    for arrival_s in (0.0, 0.025):
        scan_phase.arrived(arrival_s)
        assert math.isnan(scan_phase.next_s)
    scan_phase.arrived(0.050)
    assert scan_phase.next_s == pytest.approx(0.075)


def test_without_a_beat_everybody_goes_when_he_likes():
    assert ScanPhase().clear_s(3.21, 0.008) == 3.21


def test_one_scan_that_is_missing_changes_no_beat():
    scan_phase = steady()
    scan_phase.arrived(LAST_S + 2 * PERIOD_S)
    assert scan_phase.period_s == pytest.approx(PERIOD_S)


def test_scans_that_are_a_little_late_keep_the_beat():
    rng, scan_phase, off_s = np.random.default_rng(1), ScanPhase(), []
    for i in range(400):
        due_s = i * PERIOD_S
        if i > 100:
            off_s.append(scan_phase.next_s - due_s)
        scan_phase.arrived(due_s + rng.exponential(0.0002))
    assert np.mean(off_s) == pytest.approx(0.0002, abs=5e-5)
    assert np.std(off_s) < 0.0001, "the last arrival plus the last gap would be off by 0.0005"


def test_one_late_scan_does_not_make_the_next_one_late():
    scan_phase = steady()
    scan_phase.arrived(LAST_S + PERIOD_S + 0.006)
    assert scan_phase.next_s == pytest.approx(LAST_S + 2 * PERIOD_S)
    for i in (2, 3, 4):
        scan_phase.arrived(LAST_S + i * PERIOD_S + 0.006)  # from here on it is another beat
    assert scan_phase.next_s == pytest.approx(LAST_S + 5 * PERIOD_S + 0.006)


def test_a_lidar_that_is_a_little_slower_is_followed():
    scan_phase = steady()
    slower_s = 1.002 * PERIOD_S
    for i in range(1, 200):
        scan_phase.arrived(LAST_S + i * slower_s)
    assert scan_phase.next_s == pytest.approx(LAST_S + 200 * slower_s, abs=1e-5)


def test_another_lidar_has_another_beat():
    scan_phase = steady()
    for i in (1, 2, 3):
        scan_phase.arrived(LAST_S + i * 0.1)
    assert scan_phase.period_s == pytest.approx(0.1)


def test_between_fast_scans_nothing_could_be_kept_free():
    scan_phase = steady(period_s=0.005)
    assert math.isnan(scan_phase.next_s)
    assert scan_phase.clear_s(LAST_S + 0.005, 0.002) == LAST_S + 0.005


def test_whoever_wants_to_go_when_a_scan_is_due_goes_a_little_sooner_or_later():
    scan_phase = steady()
    due_s = scan_phase.next_s
    assert scan_phase.clear_s(due_s - 0.003, 0.0) == pytest.approx(due_s - MAX_BEFORE_S)
    assert scan_phase.clear_s(due_s + 0.001, 0.0) == pytest.approx(due_s + AFTER_S)
    assert scan_phase.clear_s(due_s + PERIOD_S, 0.0) == pytest.approx(due_s + PERIOD_S + AFTER_S)
    assert scan_phase.clear_s(due_s - 0.010, 0.0) == due_s - 0.010


def test_whoever_has_slack_comes_with_every_scan():
    scan_phase = steady()
    first_s = scan_phase.clear_s(scan_phase.next_s - 0.010, 0.008)
    assert first_s == pytest.approx(scan_phase.next_s - MAX_BEFORE_S)
    assert scan_phase.clear_s(first_s + 0.020, 0.008) == pytest.approx(first_s + PERIOD_S)
    assert scan_phase.clear_s(first_s + 0.050, 0.020) == pytest.approx(first_s + 2 * PERIOD_S)


def test_with_a_slow_lidar_the_rate_is_kept():
    scan_phase, moment_s, moments_s = steady(period_s=0.1), LAST_S, []
    while moment_s < LAST_S + 0.5:
        moment_s = scan_phase.clear_s(moment_s + 0.020, 0.008)
        moments_s.append(moment_s)
    assert len(moments_s) == pytest.approx(25, abs=1)
    assert all(0.0119 < after_s - before_s < 0.0281 for before_s, after_s in pairwise(moments_s))


@given(st.floats(0.0, 3.4 * PERIOD_S))
def test_every_moment_is_clear_of_scans_and_near(after_s):
    wanted_s = LAST_S + after_s
    moment_s = steady().clear_s(wanted_s, 0.0)
    assert abs(moment_s - wanted_s) <= (MAX_BEFORE_S + AFTER_S) / 2 + 1e-9
    since_s = (moment_s - LAST_S + PERIOD_S / 2) % PERIOD_S - PERIOD_S / 2
    assert not -MAX_BEFORE_S + 1e-9 < since_s < AFTER_S - 1e-9


def test_when_the_scans_have_stopped_deadlines_are_kept():
    wanted_s = LAST_S + 7 * PERIOD_S
    assert steady().clear_s(wanted_s, 0.008) == wanted_s


def test_everybody_meets_as_late_as_the_replies_permit():
    scan_phase = steady()
    for _ in range(400):
        scan_phase.replied(0.0004)
    assert scan_phase.clear_s(scan_phase.next_s, 0.008) == pytest.approx(scan_phase.next_s - 0.0004 - SPARE_S, abs=1e-5)


def test_one_slow_reply_counts_at_once_and_for_long():
    scan_phase = steady()
    for _ in range(400):
        scan_phase.replied(0.0004)
    scan_phase.replied(0.0025)
    assert scan_phase.before_s == pytest.approx(0.0025 + SPARE_S)
    for _ in range(10):
        scan_phase.replied(0.0004)
    assert scan_phase.before_s > 0.0025 + SPARE_S / 2


def test_a_motor_that_hardly_replies_is_not_waited_for():
    scan_phase = steady()
    scan_phase.replied(0.019)
    assert scan_phase.before_s == MAX_BEFORE_S
