from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.drivers.hokuyo.timing import DRIFT, NEW_CLOCK_AFTER_S, WRAP_MS, ClockReading, StampGate

PERIOD_MS, SWEEP_MS = 25, 19


class Cable:
    """Brings scans to a gate; keeps the sensor's clock, ours, and what was counted."""

    def __init__(self, *, sensor_ms: int = 1000, now_s: float = 500.0, stale_after_s: float = 0.1) -> None:
        self.counts: Counter[str] = Counter()
        self.gate = StampGate(stale_after_s, lambda what: self.counts.update([what]))
        self.sensor_ms, self.now_s = sensor_ms, now_s

    def scan(self, late_s: float = 0.0, *, clock_ms: int = 0) -> float | None:
        """Let one period pass and deliver the scan `late_s` late, from a sensor whose clock is off by `clock_ms`."""
        self.advance(PERIOD_MS)
        return self.gate.accept((self.sensor_ms + clock_ms) % WRAP_MS, self.now_s + late_s)

    def restart(self, *, late_s: float = 0.0, told: bool = True, clock_ms: int = 0, answer_s: float = 0.0) -> None:
        """Start a stream on a link whose answers come `late_s` late; the counter is read 50 ms before the first scan.

        clock_ms: what the counter that is told is off. answer_s: how much longer the sensor takes to tell it.
        """
        asked_s = self.now_s - 0.05 - answer_s
        counter_ms = (self.sensor_ms - 50 + SWEEP_MS + clock_ms) % WRAP_MS  # a stamp is the counter before the sweep
        reading = ClockReading(counter_ms, asked_s, asked_s + answer_s + late_s)
        self.gate.restart(late_s, reading if told else None, PERIOD_MS / 1000)

    def advance(self, ms: int) -> None:
        self.sensor_ms += ms
        self.now_s += ms / 1000


def test_lateness_is_counted_from_the_promptest_scan() -> None:
    cable = Cable()
    assert [cable.scan(late_s) for late_s in (0.020, 0.005, 0.030, 0.0, 0.030)] == pytest.approx(
        [0.0, 0.0, 0.025, 0.0, 0.030], abs=1e-4
    )


def test_a_stall_and_its_burst_leave_only_the_fresh_scans() -> None:
    cable = Cable()
    for _ in range(40):
        cable.scan()
    # Ten scans wait and arrive together when the tenth is due.
    lateness = [cable.scan((9 - index) * 0.025) for index in range(10)]
    assert [None if late_s is None else round(late_s, 3) for late_s in lateness] == [None] * 5 + [
        0.1,
        0.075,
        0.05,
        0.025,
        0.0,
    ]
    assert cable.counts == {"stale": 5}


@pytest.mark.parametrize("stale_after_s", [0.05, 0.1, 0.3])
def test_the_limit_is_the_one_that_was_set(stale_after_s: float) -> None:
    cable = Cable(stale_after_s=stale_after_s)
    cable.scan()
    assert cable.scan(stale_after_s - 0.002) is not None
    assert cable.scan(stale_after_s + 0.002) is None


@pytest.mark.parametrize("hole_s", [0.1, 3.5, 35.5, 3600.0, WRAP_MS / 1000, 3 * WRAP_MS / 1000 + 5, 86400.0])
def test_no_scan_is_lost_over_a_hole_of_any_length(hole_s: float) -> None:
    cable = Cable()
    cable.scan()
    cable.advance(round(hole_s * 1000))
    assert all(cable.scan(0.003) is not None for _ in range(5))
    assert not cable.counts


def test_the_counter_wraps_without_notice() -> None:
    cable = Cable(sensor_ms=WRAP_MS - 100)
    assert [cable.scan() for _ in range(10)] == pytest.approx([0.0] * 10, abs=1e-6)
    assert cable.sensor_ms > WRAP_MS
    assert cable.scan(0.2) is None
    assert cable.counts == {"stale": 1}


@given(
    start_ms=st.integers(0, WRAP_MS - 1),
    holes_ms=st.lists(st.integers(0, 2 * WRAP_MS), max_size=20),
    late_ms=st.lists(st.integers(0, 90), min_size=20, max_size=20),
)
def test_scans_in_order_and_not_too_late_always_pass(start_ms: int, holes_ms: list[int], late_ms: list[int]) -> None:
    cable = Cable(sensor_ms=start_ms)
    for hole_ms, delay_ms in zip(holes_ms, late_ms, strict=False):
        cable.advance(hole_ms)
        late_s = cable.scan(delay_ms / 1000)
        assert late_s is not None
        assert 0 <= late_s <= 0.09 + 1e-6
    assert not cable.counts


@pytest.mark.parametrize("drift", [-100e-6, -30e-6, 30e-6, 100e-6])
def test_drifting_crystals_do_not_make_scans_late(drift: float) -> None:
    cable = Cable()
    for _ in range(60 * 40):
        cable.now_s += PERIOD_MS / 1000 * drift
        late_s = cable.scan()
        assert late_s is not None
        assert late_s < 0.001
    assert not cable.counts


def test_a_repeated_or_earlier_stamp_is_foreign() -> None:
    cable = Cable()
    cable.scan()
    assert cable.gate.accept(cable.sensor_ms, cable.now_s + 0.025) is None
    assert cable.gate.accept(cable.sensor_ms - 25, cable.now_s + 0.025) is None
    assert cable.counts == {"foreign": 2}
    assert cable.scan() is not None


@pytest.mark.parametrize("clock_ms", [-879_000, -898_900, 879_000, -5_000, 2_000, WRAP_MS // 2])
def test_another_lidars_scans_between_ours_are_foreign(clock_ms: int) -> None:
    cable = Cable()
    cable.scan()
    for _ in range(200):
        assert cable.gate.accept((cable.sensor_ms + 10 + clock_ms) % WRAP_MS, cable.now_s + 0.010) is None
        assert cable.scan() is not None
    assert cable.counts == {"foreign": 200}


def test_a_sensor_whose_clock_restarted_is_believed_after_a_second() -> None:
    cable = Cable(sensor_ms=10_000_000)
    for _ in range(40):
        cable.scan()
    accepted = [cable.scan(clock_ms=-10_000_000) is not None for _ in range(80)]
    waited_scans = accepted.count(False)
    assert waited_scans * PERIOD_MS / 1000 == pytest.approx(NEW_CLOCK_AFTER_S, abs=PERIOD_MS / 1000)
    assert accepted == [False] * waited_scans + [True] * (80 - waited_scans)
    assert cable.counts == {"foreign": waited_scans, "clock_reset": 1}


def test_stamps_that_agree_with_nothing_are_never_believed() -> None:
    cable = Cable(sensor_ms=10_000_000)
    cable.scan()
    jumps_ms = [(-1) ** index * (index + 3) * 600_000 % WRAP_MS for index in range(100)]
    assert [cable.scan(clock_ms=jump_ms) for jump_ms in jumps_ms if 1000 < jump_ms < WRAP_MS - 1000].count(None) > 90
    assert "clock_reset" not in cable.counts


def test_after_a_restart_any_clock_is_ours_at_once() -> None:
    cable = Cable()
    cable.scan()
    cable.gate.restart()
    assert cable.scan(clock_ms=5_000_000) == 0.0


def test_a_first_scan_that_was_late_itself_does_not_spoil_the_rest() -> None:
    cable = Cable()
    cable.scan(0.35)
    assert [cable.scan(late_s) for late_s in (0.33, 0.30, 0.275)] == [0.0, 0.0, 0.0]
    for _ in range(12):
        cable.scan(0.0)
    assert cable.scan(0.0) == pytest.approx(0.0, abs=1e-4)
    assert cable.counts["foreign"] == 0


@pytest.mark.parametrize("late_s", [0.05, 0.09, 0.2, 0.5, 1.0])
@pytest.mark.parametrize("told", [True, False])
def test_a_link_that_is_late_from_the_first_scan_on_is_seen(late_s: float, told: bool) -> None:
    cable = Cable(sensor_ms=WRAP_MS - 30, stale_after_s=2.0)
    cable.restart(late_s=late_s, told=told)
    lateness = [cable.scan(late_s) for _ in range(100)]
    assert cable.gate.dated == told
    assert lateness == pytest.approx([late_s - (PERIOD_MS - SWEEP_MS) / 1000 * told] * 100, abs=0.003)


@pytest.mark.parametrize("late_s", [0.13, 0.2, 0.5, 1.0])
@pytest.mark.parametrize("told", [True, False])
def test_a_link_that_is_too_late_from_the_first_scan_on_delivers_nothing(late_s: float, told: bool) -> None:
    cable = Cable()
    cable.restart(late_s=late_s, told=told)
    assert {cable.scan(late_s) for _ in range(200)} == {None}
    assert cable.counts == {"stale": 200}
    assert cable.gate.least_s == pytest.approx(late_s, abs=0.01)


def test_a_delay_that_begins_between_the_reading_and_the_first_scan_is_seen() -> None:
    cable = Cable()
    cable.restart()
    assert {cable.scan(0.3) for _ in range(50)} == {None}


def test_a_known_delay_does_not_wear_off() -> None:
    cable = Cable()
    cable.restart(late_s=0.08)
    lateness = [cable.scan(0.08) for _ in range(600 * 40)]
    assert min(late_s for late_s in lateness if late_s is not None) > 0.07


def test_a_delay_that_grows_faster_than_a_crystal_drifts_is_seen() -> None:
    cable, rate = Cable(), 5 * DRIFT
    cable.restart()
    accepted = [cable.scan(rate * number * PERIOD_MS / 1000) for number in range(10_000)]
    last = max(number for number, late_s in enumerate(accepted) if late_s is not None)
    assert rate * last * PERIOD_MS / 1000 < 0.135
    assert accepted[-1] is None


@pytest.mark.parametrize("clock_ms", [-402_695, 402_695, -2_000, 2_000, WRAP_MS // 2])
def test_a_sensor_that_tells_another_clock_than_it_stamps_with_is_taken_by_its_quickest_answer(clock_ms: int) -> None:
    cable = Cable()
    cable.restart(late_s=0.004, clock_ms=clock_ms)
    assert [cable.scan(0.004) for _ in range(10)] == pytest.approx([0.004] * 10, abs=1e-3)
    assert not cable.gate.dated


def test_a_reading_that_takes_long_does_not_make_a_prompt_link_late() -> None:
    cable = Cable()
    cable.restart(late_s=0.002, answer_s=0.25)
    assert cable.scan(0.0) == pytest.approx(0.002)


def test_a_new_clock_does_not_make_a_late_link_prompt() -> None:
    cable = Cable(sensor_ms=10_000_000)
    cable.restart(late_s=0.095)
    cable.scan(0.095)
    accepted = [cable.scan(0.095, clock_ms=-10_000_000) for _ in range(60)]
    assert [late_s for late_s in accepted if late_s is not None] == pytest.approx([0.089] * 19, abs=0.003)
