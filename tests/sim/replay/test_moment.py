"""`replay --scan` and `--at`: the follower's answer, the decision on it and what was sent, as they were recorded."""

import json
from dataclasses import replace

import pytest

from wallride.cli import main
from wallride.runtime.recording.decision_log import DecisionEvent, FollowerEvent
from wallride.sim.recordings import RecordingError
from wallride.sim.replay.moment import moment_at_scan, moment_at_time
from wallride.sim.replay.reenact import duration_s, events_of
from wallride.sim.replay.run import run_of


@pytest.fixture(scope="module")
def slowed(log):
    """The scan before the first decision that slowed the car for a wall ahead, and that decision."""
    scan = -1
    for event in events_of(log):
        if isinstance(event, FollowerEvent):
            scan = event.sequence
        elif isinstance(event, DecisionEvent) and event.output.decision.reason == "slower: wall ahead":
            return scan, event.output.decision
    raise AssertionError("the drive to a dead end is never slowed for the wall ahead")


def test_a_scan_that_safety_slowed_the_car_at(log, slowed):
    scan, decision = slowed
    found = moment_at_scan(log, scan)
    title, follower, decided, driver, sent = found.lines()
    assert title == f"scan {scan}, {found.time_s:.3f} s"
    assert follower.endswith(": wall")
    assert decided.startswith(f"  decided   safety: {decision.speed_mps:.2f} m/s: slower: wall ahead, ")
    assert driver.endswith("the drive is of navigation")
    assert found.output is not None
    assert sent.startswith(f"  sent      {found.output.drive.speed_mps:.2f} m/s")


def test_the_decision_is_the_first_after_the_answer(log, monkeypatch):
    events = events_of(log)
    monkeypatch.setattr("wallride.sim.replay.moment.events_of", lambda _: events)
    for scan in (1, 77, 201, 300):
        at = next(i for i, e in enumerate(events) if isinstance(e, FollowerEvent) and e.sequence == scan)
        first = next(event.output for event in events[at:] if isinstance(event, DecisionEvent))
        assert moment_at_scan(log, scan).output is first


def test_a_decision_for_another_reason_before_the_next_answer_is_told_too(log, monkeypatch):
    events = events_of(log)
    answer = next(event for event in events if isinstance(event, FollowerEvent) and event.sequence == 77)
    ticks = [event for event in events if event.number > answer.number and isinstance(event, DecisionEvent)]
    late = replace(ticks[0].output, decision=replace(ticks[0].output.decision, reason="the scan is late"))
    late = replace(late, stamp_s=late.stamp_s + 0.01)
    place = events.index(ticks[0]) + 1
    told = [*events[:place], replace(ticks[0], output=late), replace(ticks[0], output=late), *events[place:]]
    monkeypatch.setattr("wallride.sim.replay.moment.events_of", lambda _: told)
    found = moment_at_scan(log, 77)
    said = found.lines()[-1]
    assert said.startswith("  then      0.010 s later navigation: ")
    assert said.endswith(": the scan is late")
    assert [one["reason"] for one in found.as_plain()["then"]] == ["the scan is late"]


def test_a_time_means_the_newest_scan_before_it(log):
    earlier, later = moment_at_scan(log, 150), moment_at_scan(log, 151)
    assert moment_at_time(log, earlier.time_s).scan == 150
    assert moment_at_time(log, (earlier.time_s + later.time_s) / 2).scan == 150
    assert moment_at_time(log, 0.0).scan == 0
    last = max(event.sequence for event in events_of(log) if isinstance(event, FollowerEvent))
    assert moment_at_time(log, duration_s(events_of(log))).scan == last


@pytest.mark.parametrize("text", ["9999", "nan", "inf", "-1"])
def test_a_time_outside_the_recording_is_refused_with_its_range(dead_end, log, text, capsys):
    assert main(["replay", str(dead_end), f"--at={text}"]) == 2
    said = capsys.readouterr()
    ends = f"{duration_s(events_of(log)):.3f}"
    assert (said.out, said.err.endswith(f": {text} s is not in it: give a time from 0 to {ends} s.\n")) == ("", True)
    assert main(["replay", str(dead_end), "--at", ends]) == 0


def test_its_time_is_that_of_the_report_which_may_lack_the_first_messages(log):
    later_ns = min(message.stamp_ns for message in log.of("scan")) + 200_000_000
    cut = replace(log, messages=[one for one in log.messages if one.stamp_ns > later_ns])
    times_s = {message.sequence: at_s for at_s, message in run_of(cut).scans}
    for scan in (77, 201):
        assert times_s[scan] == pytest.approx(moment_at_scan(log, scan).time_s, abs=0.01)


def test_a_scan_without_an_answer_names_its_neighbours(log):
    last = moment_at_time(log, duration_s(events_of(log))).scan
    with pytest.raises(
        RecordingError, match=rf"not answered scan 999999 .* the nearest: {last}\. .* scans 0 to {last}"
    ):
        moment_at_scan(log, 999999)


def test_it_says_when_the_recording_ends_before_the_decision(log, monkeypatch):
    answers_only = [event for event in events_of(log) if not isinstance(event, DecisionEvent)]
    monkeypatch.setattr("wallride.sim.replay.moment.events_of", lambda _: answers_only)
    assert moment_at_scan(log, 200).lines()[-1] == "  the recording ends before a decision on it"
    assert moment_at_scan(log, 200).as_plain()["decision"] is None


def test_the_command(dead_end, slowed, capsys):
    scan, decision = slowed
    assert main(["replay", str(dead_end), "--scan", str(scan)]) == 0
    assert f"decided   safety: {decision.speed_mps:.2f} m/s: slower: wall ahead" in capsys.readouterr().out
    assert main(["replay", str(dead_end), "--at", "5", "--json", "-"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["time_s"] <= 5.0 < answer["time_s"] + 0.03
    assert (answer["follower"]["reason"], answer["sent"]["delivered"]) == ("wall", True)
    with pytest.raises(SystemExit):
        main(["replay", str(dead_end), "--scan", "200", "--at", "5"])


def test_another_programs_recording_has_no_decisions(carried_bag, capsys):
    assert main(["replay", str(carried_bag), "--at", "1"]) == 2
    assert "need a recording of wallride" in capsys.readouterr().err
