"""The summary in the terminal is for people; its JSON file has all digits."""

import io

import pytest
from rich.console import Console

from runtime.parameters.history import SettingChange
from runtime.settings.tree import Settings
from sim.figures.summary import Sample, figures
from sim.live import drive_summary
from sim.live.session import Record


@pytest.mark.parametrize(
    ("value", "shown"),
    [(None, "-"), ({"safety": 0.4213, "navigation": 5.0}, "safety 0.421, navigation 5"), ([9.991, 10.0], "9.99, 10"),
     (True, "yes"), (1234.5, "1234"), ("loop", "loop")],
)  # fmt: skip
def test_the_summarys_values_are_for_people(value, shown):
    assert drive_summary.shown(value) == shown


def printed(summary):
    out = io.StringIO()
    Console(file=out, width=120).print(drive_summary.summary_table(summary))
    return out.getvalue()


def test_time_without_a_winner_is_none_on_the_screen():
    winners = {"nobody": 0.16, "navigation": 9.8}
    text = printed({"world": "loop", "winners": winners})
    assert "none 0.16, navigation 9.8" in text
    assert "nobody" not in text
    assert set(winners) == {"nobody", "navigation"}, "the keys of the JSON file stay"
    assert "winners │ -" in printed({"world": "loop", "winners": None})


def test_errors_are_from_the_distance_that_was_wanted_at_that_moment():
    samples = [Sample(0.1 * i, 0.1 * i, 0.0, 0.0, 1.0, 1.0 if i < 30 else 0.7, 0.5) for i in range(60)]
    change = SettingChange(1003.0, "", "ann", "wall_follow.desired_distance_m", 1.0, 0.7)
    other = SettingChange(1001.0, "", "ann", "wall_follow.kp", 13.5, 10.0)
    record = Record(samples=samples, began_s=1000.0, changes=[other, change])
    wanted = drive_summary.wanted_m(record, Settings())
    assert (wanted[29], wanted[30]) == (1.0, 0.7)
    assert figures(samples, wanted)["mean_abs_error_m"] == 0.0
    assert figures(samples, 1.0)["mean_abs_error_m"] == 0.15


@pytest.mark.parametrize(
    ("speed_mps", "said"), [(0.0, "safety: something on the lidar: uncover it, 0.30 m free"), (1.0, None)]
)
def test_the_summary_says_why_the_car_stands(speed_mps, said):
    samples = [Sample(0.1 * i, speed_mps * 0.1 * i, 0.0, 0.0, speed_mps, 1.0, 0.5) for i in range(30)]
    output = {"winner": "safety", "reason": "something on the lidar: uncover it", "measure": 0.3}
    record = Record(samples=samples, telemetry={"status": {"output": output}})
    assert drive_summary.summarize(record, Settings()).get("stands_because") == said
