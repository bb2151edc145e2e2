import pytest

from wallride.runtime.realtime.wall_clock import NS, WallClock


@pytest.mark.parametrize(
    ("year", "odd"), [(1970, True), (2023, True), (2025, False), (2037, False), (2039, True), (2126, True)]
)
def test_a_clock_that_cannot_be_right_is_said(year, odd):
    clock = WallClock(lambda: 3.0, lambda: round((year - 1970 + 0.2) * 365.2425 * 86400) * NS)
    assert bool(clock.trouble) is odd


def test_what_is_said_of_an_odd_clock_stays_the_same():
    now_s = [3.0]
    clock = WallClock(lambda: now_s[0], lambda: (2**31 + round(now_s[0])) * NS)
    said = clock.trouble
    now_s[0] = 5.0
    assert clock.trouble == said
    assert "after 2038-01-19: set it" in said
