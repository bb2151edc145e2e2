"""The summary in the terminal is for people; its JSON file has all digits."""

import io

import pytest
from rich.console import Console

from sim.live import command


@pytest.mark.parametrize(
    ("value", "shown"),
    [(None, "-"), ({"safety": 0.4213, "navigation": 5.0}, "safety 0.421, navigation 5"), ([9.991, 10.0], "9.99, 10"),
     (True, "yes"), (1234.5, "1234"), ("loop", "loop")],
)  # fmt: skip
def test_the_summarys_values_are_for_people(value, shown):
    assert command._shown(value) == shown


def printed(summary):
    out = io.StringIO()
    Console(file=out, width=120).print(command._table(summary))
    return out.getvalue()


def test_time_without_a_winner_is_none_on_the_screen():
    winners = {"nobody": 0.16, "navigation": 9.8}
    text = printed({"world": "loop", "winners": winners})
    assert "none 0.16, navigation 9.8" in text
    assert "nobody" not in text
    assert set(winners) == {"nobody", "navigation"}, "the keys of the JSON file stay"
    assert "winners │ -" in printed({"world": "loop", "winners": None})
