"""Durations are counted truly, and nobody has to wait for it."""

import gc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.runtime.observed import HandClock
from wallride.runtime.realtime.stage_timing import MAX_UNCOUNTED, SUMMED_EVERY_S, Histogram, StageTimer


@given(st.lists(st.floats(0, 100), min_size=1, max_size=50), st.sampled_from([0.0, 0.5, 0.99, 0.999, 1.0]))
def test_a_quantile_is_right_to_3_percent(durations_s, share):
    histogram = Histogram()
    for duration_s in durations_s:
        histogram.add(duration_s)
    (found_s,) = histogram.quantiles_s([share])
    ordered = sorted(durations_s)
    at = max(0, -int(-share * len(ordered) // 1) - 1)
    assert found_s == pytest.approx(ordered[at], rel=0.033, abs=1.01e-7)


def test_what_is_absurd_is_counted_all_the_same():
    histogram = Histogram()
    for duration_s in (-1.0, 1e9):
        histogram.add(duration_s)
    assert (histogram.total, histogram.fields()["max"]) == (2, 1e15)


def test_nothing_counted_is_nothing():
    assert Histogram().fields() == {"count": 0, "p50": 0.0, "p99": 0.0, "p99_9": 0.0, "max": 0.0}


def test_a_stage_lasts_from_begin_to_end():
    clock = HandClock()
    stages = StageTimer(clock)
    stages.follow.begin()
    clock.now_s += 0.001
    stages.follow.end()
    assert stages.fields()["follow"]["p50"] == pytest.approx(1000, rel=0.03)


def test_decoding_is_what_is_left_after_reading():
    clock = HandClock()
    stages = StageTimer(clock)
    clock.now_s += 0.0005
    stages.on_scan(received_s=100.0, reading_s=0.0001)
    assert stages.fields()["read"]["max"] == pytest.approx(100)
    assert stages.fields()["decode"]["max"] == pytest.approx(400)


def test_the_summary_is_made_once_a_second():
    clock = HandClock()
    stages = StageTimer(clock)
    assert stages.fields() == {"missed_ticks": 0}
    stages.on_tick(0.01, 3)
    assert stages.fields() == {"missed_ticks": 0}
    clock.now_s += SUMMED_EVERY_S
    assert stages.fields()["missed_ticks"] == 3
    assert stages.fields()["loop_lag"]["max"] == pytest.approx(10_000)


def test_collections_are_timed_while_they_are_watched():
    stages = StageTimer(HandClock())
    stages.watch_collections()
    try:
        gc.collect(0)
        gc.collect(2)
    finally:
        stages.ignore_collections()
    gc.collect(2)
    assert stages.collections[0].total >= 1
    assert stages.collections[2].total == 1


def test_the_table_has_a_line_for_what_happened_only():
    stages = StageTimer(HandClock())
    stages.mux.begin()
    stages.mux.end()
    title, *lines = stages.table()
    assert title.split() == ["us", "count", "p50", "p99", "p99.9", "max"]
    assert [line.split()[0] for line in lines] == ["mux"]


def test_what_was_timed_is_counted_when_there_is_time():
    clock = HandClock()
    stages = StageTimer(clock)
    for _ in range(3):
        stages.mux.begin()
        stages.mux.end()
    assert stages.mux.histogram.total == 0
    stages.count()
    stages.count()
    assert stages.mux.histogram.total == 3


def test_a_clock_that_nobody_reads_does_not_grow():
    stages = StageTimer(HandClock())
    for _ in range(3 * MAX_UNCOUNTED):
        stages.mux.end()
    stages.count()
    assert stages.mux.histogram.total == MAX_UNCOUNTED
