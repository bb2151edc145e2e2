import pytest

from runtime.realtime.wall_clock import NS, WallClock


@pytest.mark.parametrize(
    ("year", "odd"), [(1970, True), (2023, True), (2025, False), (2037, False), (2039, True), (2126, True)]
)
def test_a_clock_that_cannot_be_right_is_said(year, odd):
    clock = WallClock(lambda: 3.0, lambda: round((year - 1970 + 0.2) * 365.2425 * 86400) * NS)
    assert bool(clock.trouble) is odd
