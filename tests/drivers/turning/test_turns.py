"""HeadSamples to turns: where a turn ends, when each sample was taken, how late the link is."""

from collections import Counter

import numpy as np
import pytest

from wallride.drivers.turning.samples import HeadSamples, lost_samples
from wallride.drivers.turning.turns import LONGEST_TURN_S, Turn, Turns

SAMPLE_S = 1 / 4000
PER_TURN = 400


def samples(first: int, count: int) -> HeadSamples:
    """Return samples by their number, one every 0.9 degrees; a sample's range is its number."""
    number = np.arange(first, first + count)
    deg = np.asarray(number * (360.0 / PER_TURN) % 360.0, np.float64)
    return HeadSamples(deg, deg, number.astype(np.float64))


class Line:
    """A line on which samples come in chunks, `late_s` after the last one of them was taken."""

    def __init__(self, cut_deg: float = 0.0, least_s: float = 0.0) -> None:
        self.counts: Counter[str] = Counter()
        self.turns = Turns(SAMPLE_S, cut_deg, lambda what: self.counts.update([what]), least_s=least_s)
        self.sent = 0

    def run(self, count: int, *, chunk: int = 40, late_s: float = 0.0) -> list[Turn]:
        found = []
        for _ in range(count // chunk):
            part = samples(self.sent, chunk)
            self.sent += chunk
            found += self.turns.add(part, (self.sent - 1) * SAMPLE_S + late_s)
        return found


@pytest.mark.parametrize("chunk", [1, 7, 40, 333, 1000])
@pytest.mark.parametrize("cut_deg", [0.0, 90.0, 181.0])
def test_a_turn_begins_at_the_cut_and_has_every_sample_once(chunk, cut_deg):
    line = Line(cut_deg)
    turns = line.run(PER_TURN + 3 * max(PER_TURN, chunk), chunk=chunk)
    assert len(turns) >= 2
    numbers = np.concatenate([turn.range_m for turn in turns])
    np.testing.assert_array_equal(np.diff(numbers), 1)
    for turn in turns:
        assert turn.deg.size == PER_TURN
        assert (turn.deg[0] - cut_deg) % 360 < 360 / PER_TURN


@pytest.mark.parametrize("chunk", [1, 40, 160])
def test_each_sample_has_its_own_time_whatever_the_chunks(chunk):
    for turn in Line().run(4 * PER_TURN, chunk=chunk):
        taken_s = turn.range_m * SAMPLE_S
        np.testing.assert_allclose(turn.end_s - turn.ago_s, taken_s, atol=2e-3)  # the sample time is being measured
        assert turn.duration_s == pytest.approx((PER_TURN - 1) * SAMPLE_S, rel=0.01)


def test_the_first_turn_is_dropped_where_it_is_not_whole():
    line = Line()
    line.sent = 137
    assert line.run(PER_TURN, chunk=10)[:1] == []
    assert line.run(PER_TURN, chunk=10)[0].range_m[0] == PER_TURN


def test_a_delay_that_builds_up_is_seen_and_taken_off():
    line = Line()
    assert all(turn.late_s < 0.003 for turn in line.run(3 * PER_TURN))
    late = line.run(2 * PER_TURN, late_s=0.25)
    assert [turn.late_s for turn in late] == pytest.approx([0.25, 0.25], abs=0.02)
    for turn in late:
        assert turn.end_s == pytest.approx(turn.range_m[-1] * SAMPLE_S, abs=0.02)
    assert line.run(2 * PER_TURN)[-1].late_s < 0.005  # and forgotten when the link has caught up


@pytest.mark.parametrize("pause_s", [0.3, 2.0])
def test_a_pause_before_the_first_samples_is_no_delay(pause_s):
    line = Line(least_s=0.02)
    for wait_s in (0.0, 0.1):  # the announcement, and a part of a frame
        assert line.turns.add(lost_samples(0), wait_s - pause_s) == []
    turns = line.run(4 * PER_TURN)
    assert [turn.late_s for turn in turns] == pytest.approx([0.02] * len(turns), abs=0.003)
    assert line.run(2 * PER_TURN, late_s=0.25)[-1].late_s == pytest.approx(0.27, abs=0.02)


def test_lost_samples_are_no_delay():
    line = Line()
    line.run(3 * PER_TURN)
    line.turns.add(lost_samples(400), line.sent * SAMPLE_S + 0.1)
    line.sent += 400
    assert all(turn.late_s < 0.01 for turn in line.run(3 * PER_TURN))


def test_the_least_delay_is_added():
    turn = Line(least_s=0.02).run(3 * PER_TURN)[0]
    assert turn.late_s >= 0.02
    assert turn.end_s == pytest.approx(turn.range_m[-1] * SAMPLE_S - 0.02, abs=0.003)


def test_the_sample_time_is_measured():
    line = Line()
    for k in range(200):
        line.turns.add(samples(k * 100, 100), (k + 1) * 100 * SAMPLE_S * 1.03)  # 3 % slower than it says
    assert line.turns.sample_s == pytest.approx(SAMPLE_S * 1.03, rel=0.005)


def test_a_head_that_stands_fills_no_memory():
    line = Line()
    turning = line.run(3 * PER_TURN)
    assert turning
    standing = HeadSamples(np.full(200, 45.0), np.full(200, 45.0), np.ones(200))
    ended = [line.turns.add(standing, 1.0 + k * 200 * SAMPLE_S) for k in range(100)]
    assert not any(ended[1:])  # a head that jumps ends a turn once
    assert line.counts["endless turn"] >= int(100 * 200 * SAMPLE_S / LONGEST_TURN_S) - 1
