from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.hokuyo.timing import NEW_CLOCK_AFTER_S, WRAP_MS, StampGate

PERIOD_MS = 25


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

    def advance(self, ms: int) -> None:
        self.sensor_ms += ms
        self.now_s += ms / 1000


def test_prompt_scans_are_not_late() -> None:
    cable = Cable()
    assert [cable.scan() for _ in range(100)] == pytest.approx([0.0] * 100, abs=1e-9)


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
