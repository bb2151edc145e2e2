"""The summary in the terminal is for people; its JSON file has all digits."""

import pytest

from sim.live import command


@pytest.mark.parametrize(
    ("value", "shown"),
    [(None, "-"), ({"safety": 0.4213, "navigation": 5.0}, "safety 0.421, navigation 5"), ([9.991, 10.0], "9.99, 10"),
     (True, "yes"), (1234.5, "1234"), ("loop", "loop")],
)  # fmt: skip
def test_the_summarys_values_are_for_people(value, shown):
    assert command._shown(value) == shown
