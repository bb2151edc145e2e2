"""The period of a lidar from its stamps, and what waits longer for a slow one."""

import math

import pytest

from wallride.runtime.control.perception.scan_rate import SLOWEST_S, USUAL_S, ScanRate


def rate_of(*stamps_s: float) -> ScanRate:
    rate = ScanRate()
    for stamp_s in stamps_s:
        rate.note(stamp_s)
    return rate


def every(period_s: float, count: int = 10) -> list[float]:
    return [100.0 + k * period_s for k in range(count)]


@pytest.mark.parametrize("period_s", [0.01, 0.025, 0.0255, USUAL_S])
def test_nothing_waits_longer_for_a_lidar_of_40_hz(period_s):
    assert rate_of(*every(period_s)).waits_s == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("hz", [5.5, 7.0, 10.0, 20.0])
def test_a_slow_lidar_is_waited_for(hz):
    rate = rate_of(*every(1 / hz))
    assert rate.period_s == pytest.approx(1 / hz)
    assert rate.waits_s == pytest.approx(1 / hz - USUAL_S)


def test_lost_scans_make_no_slow_lidar():
    stamps_s = [stamp for k, stamp in enumerate(every(0.025, 40)) if k % 3 != 1]
    assert rate_of(*stamps_s).waits_s == 0.0


def test_a_gap_is_no_period():
    assert rate_of(0.0, 1.0, 2.0, 3.0).waits_s == 0.0
    assert rate_of(*every(0.1), 105.0, 105.1).period_s == pytest.approx(0.1)


def test_a_lidar_slower_than_5_hz_is_not_waited_for():
    assert rate_of(*every(0.28)).period_s == SLOWEST_S


def test_one_scan_may_be_noted_again():
    rate = ScanRate()
    for stamp_s in every(0.1):
        assert rate.note(stamp_s) == rate.note(stamp_s)
    assert rate.period_s == pytest.approx(0.1)


def test_stamps_that_go_back_or_are_none_tell_nothing():
    rate = rate_of(*every(0.1), 50.0, math.nan, 60.0)
    assert math.isfinite(rate.waits_s)
