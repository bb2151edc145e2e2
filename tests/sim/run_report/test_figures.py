"""A report's numbers are those of the car and of the simulator's summary, from the same code."""

import math
import re

import numpy as np
import pytest
from rich.console import Console

from wallride.runtime.settings.tree import Settings
from wallride.sim.figures import summary
from wallride.sim.replay.command import _tell
from wallride.sim.replay.drive_log import read_log
from wallride.sim.replay.figures import numbers, samples, slowed, stops, truth_of
from wallride.sim.replay.moment import moment_at_scan
from wallride.sim.replay.run import DrivenPath, MuxChange, RecordedRun, Series
from wallride.sim.run_report.events import slower_table, stops_table

NOTHING = np.empty(0)


def made(times_s, sent_mps, changes=(), **values):
    times_s = np.asarray(times_s, dtype=np.float64)
    still = np.zeros_like(times_s)
    fields = {
        "name": "made", "car": "car1", "version": "", "began": "", "source": "", "settings": Settings(), "notes": (),
        "scans": [], "error": Series(NOTHING, NOTHING), "wish": Series(NOTHING, NOTHING),
        "path": DrivenPath(times_s, still, still, still, np.asarray(sent_mps, dtype=np.float64)),
        "sent": Series(times_s, np.asarray(sent_mps, dtype=np.float64)), "steering": Series(times_s, still),
        "changes": list(changes), "duration_s": float(times_s[-1]) if len(times_s) else 0.0,
    }  # fmt: skip
    return RecordedRun(**{**fields, **values})


def change(time_s, winner, reason, allowed_mps=0.0):
    return MuxChange(time_s, winner, "navigation", reason, math.nan, 1.0, allowed_mps, allowed_mps, delivered=True)


def test_the_score_is_the_cars_own(run, last_status):
    found = numbers(run)
    for name in ("mean_abs_m", "rms_m"):
        # The recorded speed is of a decision, the car's own of the scan: they part at one scan of a start or a stop.
        assert found["distance_error"][name] == pytest.approx(last_status["distance_error"][name], abs=1e-4)
    assert found["scan_to_motor_ms"] == last_status["scan_to_motor_ms"]
    assert found["winners"] == {name: round(s, 2) for name, s in last_status["seconds_by_winner"].items()}
    assert found["scans"] == 360


def test_standing_does_not_count_in_the_cars_own_score():
    times_s = np.array([0.0, 1.0, 2.0, 3.0])
    error = Series(times_s, np.array([0.5, 0.1, 0.1, 0.7]))
    assert numbers(made(times_s, [0, 1, 1, 0], error=error))["distance_error"] == {"mean_abs_m": 0.1, "rms_m": 0.1}


def test_a_drive_that_never_began_says_why():
    reason = "something on the lidar: uncover it"
    run = made([0.0, 1.0, 2.0], [0, 0, 0], [change(0.0, "none", "starting"), change(0.5, "safety", reason)])
    assert stops_table(stops(run), run) == f"<p>The car never set off: safety, {reason}.</p>"
    assert "never told to stop" in stops_table([], made([0.0, 1.0], [0, 1], [change(0.0, "navigation", "wall", 1.0)]))
    assert "never told to stop" in stops_table([], made([0.0], [0]))


def test_the_figures_are_the_summarys(run):
    expected = summary.figures(samples(run), 1.0)
    found = numbers(run)
    assert {name: found[name] for name in expected if name != "duration_s"} == {
        name: value for name, value in expected.items() if name != "duration_s"
    }
    assert expected["distance_m"] > 5
    assert expected["min_clearance_m"] is not None


def test_what_the_car_believed_is_near_the_truth(drive, run):
    _, car, _ = drive
    assert numbers(run)["distance_m"] == pytest.approx(abs(car.motor.state.distance_m), rel=0.25)
    assert run.path.x_m[-1] == pytest.approx(run.status["odom"]["x_m"], abs=1e-6)


def test_the_dead_end_is_a_stop_by_safety(run):
    found = stops(run)
    assert found
    assert found[0].winner == "safety"
    assert found[0].reason in {"boxed in", "wall ahead", "braking: wall ahead"}
    assert 4 < found[0].from_s < 7
    assert slowed(run)


def test_a_scan_named_for_being_slower_is_the_one_of_that_decision(run, path):
    page = slower_table(run)
    reasons = re.findall(r"<td>safety</td><td>([^<]+)</td><td>[^<]+</td><td><span [^>]+>scan (\d+),", page)
    assert {change.reason for change in slowed(run)} == {reason for reason, _ in reasons}
    log = read_log(path)
    for reason, scan in reasons:
        assert moment_at_scan(log, int(scan)).output.decision.reason == reason
    assert f"wallride replay {path.name} --scan " in page
    assert slower_table(made([0.0], [0])) == ""


def test_stops_begin_and_end_with_what_was_sent():
    told = made(
        [0.0, 0.5, 1.0, 2.0, 2.5, 3.0, 4.0], [0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0],
        [change(0.0, "nobody", "no word from teleop or navigation"), change(0.5, "navigation", "wall", 1.0),
         change(2.0, "safety", "wall ahead"), change(2.5, "safety", "boxed in"),
         change(3.0, "navigation", "wall", 1.0), change(4.0, "e-stop", "e-stop by ann")],
    )  # fmt: skip
    first, second = stops(told)
    assert (first.from_s, first.until_s, first.winner, first.reason) == (2.0, 3.0, "safety", "wall ahead")
    assert first.also == ("boxed in",)
    assert (second.from_s, second.winner, second.reason) == (4.0, "e-stop", "e-stop by ann")
    assert math.isnan(second.until_s)
    assert numbers(told)["standing_s"] == 1.0


def test_standing_before_the_first_movement_or_for_a_moment_is_no_stop():
    assert stops(made([0, 1, 2], [0, 0, 0], [change(0.0, "permit", "no operator permits autonomy")])) == []
    assert stops(made([0, 1, 1.02, 2], [1, 0, 1, 1])) == []


def test_a_run_without_anything_has_figures_too():
    found = numbers(made([], []))
    assert (found["distance_m"], found["mean_abs_error_m"], found["stops"]) == (0.0, None, 0)
    assert found["distance_error"] == {"mean_abs_m": None, "rms_m": None}


def test_the_truth_is_taken_as_it_is_written():
    told = {"rms_error_m": 0.031, "laps": 2, "lap_times_s": [20.1, 19.9], "world": "loop", "faults": {}}
    assert truth_of(told) == {"rms_error_m": 0.031, "laps": 2, "lap_times_s": [20.1, 19.9], "world": "loop"}


def test_what_happened_once_is_told_as_once(capsys):
    change = MuxChange(0.5, "safety", "navigation", "slower: wall ahead", 0.0, 1.0, 0.5, 0.5, delivered=True)
    stop = MuxChange(1.0, "safety", "navigation", "boxed in", 0.0, 1.0, 0.0, 0.0, delivered=True)
    console = Console(width=120, no_color=True)
    slowed = made([0.0, 0.5, 1.0], [1.0, 0.5, 0.5], [change])
    _tell(console, slowed, numbers(slowed))
    assert "they would have slowed it once: slower: wall ahead" in capsys.readouterr().out
    stopped = made([0.0, 0.5, 1.0, 2.0], [1.0, 0.5, 0.0, 0.0], [change, stop])
    _tell(console, stopped, numbers(stopped))
    said = capsys.readouterr().out
    assert "they would have stopped it once" in said
    assert "and slowed it once" in said
    assert "0.00)" not in said


@pytest.mark.parametrize(
    ("left_at_s", "back_at_s", "settled_s"),
    [(9.0, 9.5, 1.5), (3.0, 3.5, 3.5), (3.0, 99.0, None), (0.0, 0.0, 1.5)],
)
def test_a_later_corner_does_not_unsettle_a_drive(left_at_s, back_at_s, settled_s):
    times_s = np.arange(0, 10, 0.1).round(3)
    outside = (times_s < 1.5) | ((times_s >= left_at_s) & (times_s < back_at_s))
    rows = [
        summary.Sample(now_s, now_s, 0.0, 0.0, 1.0, 1.2 if out else 1.01, 0.5)
        for now_s, out in zip(times_s, outside, strict=True)
    ]
    found = summary.figures(rows, 1.0)["settle_s"]
    assert found == (None if settled_s is None else pytest.approx(settled_s, abs=0.11))


def test_the_mean_speed_is_that_of_the_time_under_way():
    rows = [summary.Sample(0.1 * n, 0.1 * min(n, 50), 0.0, 0.0, float(n < 50), 1.0, 1.0) for n in range(200)]
    assert summary.figures(rows, 1.0)["mean_speed_mps"] == pytest.approx(1.0, rel=0.03)
