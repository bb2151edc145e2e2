"""A report tells what went wrong, wherever it was recorded, and shows a drive by an own law without that law."""

import json
import math
import shutil
from dataclasses import replace

import pytest

from tests.own_laws import STRAIGHT
from tests.sim.replay.recorded import options, record
from tests.sim.run_report.test_page import data_of
from wallride.cli import main
from wallride.runtime.control.own_laws import law_class
from wallride.runtime.realtime.wall_clock import NS
from wallride.sim.recordings import RecordingError
from wallride.sim.replay import command as replaying
from wallride.sim.replay.drive_log import DriveLog, LoggedMessage, read_log
from wallride.sim.replay.faults import UNHEARD, faults_in
from wallride.sim.replay.figures import numbers
from wallride.sim.replay.moment import moment_at_time
from wallride.sim.replay.run import run_of
from wallride.sim.run_report.page import page
from wallride.sim.run_report.shown import shown
from wallride.sim.run_report.track import spans

ABSENT = {"link": "absent", "message": "unplugged"}
READY = {"link": "ready", "message": "VESC"}


def message(topic, at_s, **fields):
    return LoggedMessage(topic, "", round(at_s * NS), json.dumps(fields).encode())


def logged(at_s, level, words):
    return message("log", at_s, level=level, name="wallride.health", message=words)


def words_of(*messages):
    return [fault.words for fault in faults_in(DriveLog("made", list(messages)))]


def test_warnings_and_errors_of_the_log_are_faults_and_its_other_lines_are_not():
    lines = [logged(1, "INFO", "navigation: wall"), logged(2, "ERROR", "motor fault"), logged(3, "WARNING", "late")]
    assert words_of(*lines) == ["motor fault", "late"]


def test_a_device_that_only_a_status_misses_is_a_fault():
    assert words_of(message("status", 5, motor=ABSENT, lidar=READY, fault="")) == ["motor absent: unplugged"]
    assert words_of(message("status", 5, motor=READY, lidar=READY, fault="overheated")) == ["motor fault: overheated"]


def test_a_device_that_has_not_been_opened_yet_and_commands_before_it_is_there_are_none():
    assert words_of(message("status", 5, motor={"link": "absent", "message": "not opened yet"}, fault="")) == []
    assert words_of(message("decision", 0, delivered=False), message("decision", 1, delivered=True)) == []


def test_the_same_words_of_log_and_status_are_told_once_and_a_second_loss_again():
    first = [logged(1, "WARNING", "motor absent: unplugged"), message("status", 1.5, motor=ABSENT, fault="")]
    later = [message("status", 2, motor=ABSENT), message("status", 3, motor=READY), message("status", 9, motor=ABSENT)]
    assert words_of(*first, *later) == ["motor absent: unplugged"] * 2


def counted(at_s, **counts):
    return message("status", at_s, motor=READY | {"counts": counts}, lidar=READY)


def test_what_the_devices_counted_is_a_fault_as_often_as_the_summary_of_a_simulation_has_it():
    assert words_of(counted(1, missed_reply=1), counted(2, missed_reply=1)) == ["motor missed reply once"]
    drive = [counted(1), counted(2, missed_reply=1), counted(2.5, missed_reply=3), counted(9, missed_reply=4)]
    (first, second) = faults_in(DriveLog("made", drive))
    assert (first.words, first.stamp_ns, first.lasted_s) == ("motor missed reply 3 times", 2 * NS, 0.5)
    assert (second.words, second.stamp_ns, math.isnan(second.lasted_s)) == ("motor missed reply once", 9 * NS, True)


def test_commands_that_no_longer_arrive_are_one_fault_with_its_length():
    decisions = [message("decision", at_s, delivered=at_s < 2 or at_s >= 4) for at_s in (0, 1, 2, 3, 4, 5)]
    (fault,) = faults_in(DriveLog("made", decisions))
    assert (fault.words, fault.stamp_ns, fault.lasted_s) == (UNHEARD, 2 * NS, 2.0)


@pytest.fixture(scope="module")
def pulled(tmp_path_factory):
    """A drive whose motor controller is unplugged after 4 s."""
    path = tmp_path_factory.mktemp("runs") / "pulled.mcap"

    def pull(car):
        car.motor.pull()

    record(path, seconds=7.0, events=[(4.0, pull)])
    return path


def test_the_page_lists_and_marks_every_fault_of_a_drive_that_lost_its_motor(pulled):
    run = run_of(read_log(pulled))
    told = page(shown(run))
    words = [fault.words for _, fault in run.faults]
    assert words[0] == "motor absent: in memory" or words[0] == UNHEARD
    assert {"motor absent: in memory", UNHEARD} <= set(words)
    assert f"<h2>Faults ({len(words)})</h2>" in told
    assert f"<td>{UNHEARD}, for " in told
    marks = data_of(told)["charts"]["speed"]["marks"]
    assert [text for _, text in marks if text.startswith("F")] == [f"F{n}" for n in range(1, len(words) + 1)]
    assert [fault["words"] for fault in numbers(run)["faults"]] == words


def test_the_page_of_a_drive_without_faults_says_so(run):
    assert "Nothing was recorded that went wrong." in page(shown(run))


def test_each_reason_is_told_with_its_length(run):
    told = page(shown(run))
    assert all(f"<td>{change.winner}</td><td>{change.reason}</td>" in told for change in run.changes)


def test_a_moment_names_the_loss_that_follows_it(pulled):
    lines = moment_at_time(read_log(pulled), 4.0).lines()
    assert any(line.startswith("  fault     ") and line.endswith(UNHEARD) for line in lines)
    assert moment_at_time(read_log(pulled), 2.0).faults == []


def test_a_time_beyond_the_recording_is_refused(pulled):
    with pytest.raises(RecordingError, match=r"60 s is not in it: give a time from 0 to"):
        moment_at_time(read_log(pulled), 60.0)


def test_a_drive_by_an_own_law_has_a_page_where_the_law_is_not(law_file, tmp_path, monkeypatch, capsys):
    method = law_file(STRAIGHT)
    law_class.load_law("wall_follow", method)
    record(tmp_path / "own.mcap", seconds=2.0, sections={"wall_follow": {"method": method}})
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    shutil.move(tmp_path / "own.mcap", elsewhere / "own.mcap")
    (tmp_path / f"{method.partition(':')[0]}.py").unlink()
    monkeypatch.setattr(law_class, "_loaded", {})
    monkeypatch.delitem(__import__("sys").modules, method.partition(":")[0])
    monkeypatch.chdir(elsewhere)
    assert main(["report", "own.mcap"]) == 0
    assert method in (elsewhere / "own.html").read_text()
    with pytest.raises(RecordingError, match=r"its own law cannot be used: there is no own_law"):
        replaying.run(options(elsewhere / "own.mcap", scan=None, at_s=None, publish=False, json=None))
    capsys.readouterr()


def test_of_several_laps_each_has_its_own_path(run):
    truth = {"lap_times_s": [2.0, 3.0, 2.5], "began_unix_s": run.zero_unix_s}
    told = page(shown(run, truth))
    assert [title for title in ("lap 1", "lap 2", "lap 3", "after the last lap") if f"<h3>{title}</h3>" in told] == [
        "lap 1", "lap 2", "lap 3", *(["after the last lap"] if run.duration_s > 9.5 else []),
    ]  # fmt: skip
    assert 'data-from="2.000" data-until="5.000"' in told
    assert 'class="lap"' not in page(shown(run))


def test_a_long_drive_without_laps_is_drawn_in_parts(run):
    long = replace(run, duration_s=200.0)
    assert [title for title, *_ in spans(shown(long))] == ["part 1 of 3", "part 2 of 3", "part 3 of 3"]
    assert spans(shown(run)) == [("", 0.0, math.inf)]
