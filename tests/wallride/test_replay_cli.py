"""`wallride replay` and `wallride report` as scripts use them: exit codes, JSON, one line when something is wrong."""

import fcntl
import json
import os
import time
from dataclasses import replace
from pathlib import Path

import pytest

from tests.sim.replay.recorded import record
from tests.typed import typed
from wallride.runtime.recording.decision_codec import decode
from wallride.runtime.recording.decision_log import SettingsEvent
from wallride.runtime.recording.laws_fingerprint import laws_fingerprint
from wallride.runtime.settings.recording import recordings_folder
from wallride.sim.replay import reenact
from wallride.sim.replay.drive_log import DriveLog


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    path = tmp_path_factory.mktemp("drives") / "drive.mcap"
    record(path, seconds=2.0, sections={"recording": {"world": "loop --side left"}})
    return path


@pytest.fixture
def carried():
    return Path(__file__).resolve().parents[1] / "data" / "urg04lx_people_40.bag"


def wallride(*arguments):
    options = typed(*arguments)
    return options.run(options)


@pytest.mark.parametrize("command", [["replay"], ["report", "-o", "page.html"]])
def test_without_a_file_the_newest_recording_is_taken_and_named(command, drive, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    monkeypatch.chdir(tmp_path)
    assert wallride(*command) == 2
    assert "there is no recording on this computer yet" in capsys.readouterr().err
    folder = recordings_folder("") / "simulated" / "sim"
    folder.mkdir(parents=True)
    names = ["20261126T050000Z-b0001-00001", "20261126T040000Z-b0001-00002", "20261126T060000Z-b0001-00003-stop-wall"]
    for age, name in zip((90, 10, 0), names, strict=True):
        (folder / f"{name}.mcap").write_bytes(drive.read_bytes())
        os.utime(folder / f"{name}.mcap", (time.time() - age,) * 2)
    assert wallride(*command) == 0
    said = capsys.readouterr().err
    path, about = said.removeprefix("the newest recording: ").removesuffix(")\n").split(" (")
    assert path == f"{folder / names[1]}.mcap", "not a black box"
    world, length, age = about.split(", ")
    assert (world, age[-5:]) == ("loop --side left", "s old")
    assert 0.0 < float(length.removesuffix(" s long")) < 60.0


def test_a_recording_that_is_still_written_is_said_to_be_one(drive, tmp_path, capsys):
    unfinished = tmp_path / "now.mcap"
    unfinished.write_bytes(drive.read_bytes())
    with unfinished.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert wallride("replay", unfinished) == 0
    assert capsys.readouterr().err == f"{unfinished} is still being recorded: this is of what it holds so far\n"
    assert wallride("replay", unfinished) == 0
    assert capsys.readouterr().err == ""


def test_a_difference_is_1_and_named(drive, capsys):
    assert wallride("replay", drive, "--set", "wall_follow.desired_distance_m=0.9") == 1
    said = capsys.readouterr().out
    assert "first difference: scan 0, " in said
    assert "the follower's steering [rad]: recorded" in said


def test_a_difference_after_an_unknown_beginning_is_not_laid_on_the_laws(tmp_path, monkeypatch, capsys):
    path = tmp_path / "middle.mcap"
    record(path, world="corridor", seconds=9.0, forgets=400)
    monkeypatch.setattr(reenact, "SETTLES_S", 0.0)
    monkeypatch.setattr(reenact, "CLOSE", 0.0)
    assert wallride("replay", path) == 3
    assert "decisions differ, as what the laws had learnt before may explain" in capsys.readouterr().out


def test_by_changed_laws_a_difference_is_3_and_no_fault(drive, capsys, monkeypatch):
    monkeypatch.setattr(reenact, "laws_fingerprint", lambda *_: "0ther1aws000")
    assert wallride("replay", drive, "--set", "wall_follow.desired_distance_m=0.9") == 3
    said = capsys.readouterr().out
    assert f"the laws have changed since: recorded with 0.1.0 (laws {laws_fingerprint()})" in said
    assert "(laws 0ther1aws000)" in said
    assert "come out otherwise, which is no fault of the recording" in said


def test_changed_laws_that_decide_the_same_are_the_same(drive, capsys, monkeypatch):
    monkeypatch.setattr(reenact, "laws_fingerprint", lambda *_: "0ther1aws000")
    assert wallride("replay", drive) == 0
    assert capsys.readouterr().out.endswith(": identical\n")


def test_a_recording_that_does_not_name_its_laws_is_not_blamed(drive, capsys, monkeypatch):
    fact = DriveLog.fact
    monkeypatch.setattr(DriveLog, "fact", lambda log, name: "" if name == "laws" else fact(log, name))
    assert wallride("replay", drive, "--set", "wall_follow.desired_distance_m=0.9", "--json", "-") == 3
    assert "may have changed since: it was recorded by wallride" in json.loads(capsys.readouterr().out)["laws_changed"]


def test_settings_that_do_not_exist_any_more_are_left_out_and_named(drive, capsys, monkeypatch):
    def decoded(payload):
        return [
            replace(event, settings={**event.settings, "safety": {**event.settings["safety"], "wings": 2}})
            if isinstance(event, SettingsEvent) else event
            for event in decode(payload)
        ]  # fmt: skip

    monkeypatch.setattr(reenact, "decode", decoded)
    assert wallride("replay", drive) == 0
    assert "its settings safety.wings are not known to this version: they are left out." in capsys.readouterr().out


def test_a_difference_in_json(drive, capsys):
    assert wallride("replay", drive, "--set", "wall_follow.speed_mps=1", "--json", "-") == 1
    found = json.loads(capsys.readouterr().out)
    assert found["identical"] is False
    assert found["differing_decisions"] > 10
    assert {"scan": 0, "recorded": 1.5, "replayed": 1.0}.items() <= found["differences"][0].items()


def test_the_json_of_the_same(drive, tmp_path, capsys):
    target = tmp_path / "replay.json"
    assert wallride("replay", drive, "--json", target) == 0
    found = json.loads(target.read_text())
    assert found["identical"]
    assert found["exact"]
    assert "identical" in capsys.readouterr().out


def test_somebody_elses_drive_is_told_about(carried, capsys):
    assert wallride("replay", carried) == 0
    said = capsys.readouterr().out
    assert "40 scans" in said
    assert "wall seen in" in said


def test_somebody_elses_drive_in_json(carried, capsys):
    assert wallride("replay", carried, "--json", "-", "--set", "wall_follow.side=right") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["scans"], found["side"]) == (40, "right")
    assert "stopped" in found


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("replay", "nowhere.mcap"), "nowhere.mcap does not exist"),
        (("replay", "README.md"), "is no recording that can be read"),
        (("report", "nowhere.mcap"), "nowhere.mcap does not exist"),
    ],
)
def test_what_cannot_be_read_is_2_and_one_line(arguments, words, capsys):
    assert wallride(*arguments) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_a_wrong_setting_is_2_and_one_line(drive, capsys):
    assert wallride("replay", drive, "--set", "safety.nothing=1") == 2
    assert capsys.readouterr().err.startswith("wallride: --set: safety.nothing is not a setting; known here: ")


@pytest.mark.parametrize("speed", ["0", "-1", "1000", "fast"])
def test_a_speed_beyond_reason_is_refused(drive, speed, capsys):
    with pytest.raises(SystemExit):
        wallride("replay", drive, "--publish", "--speed", speed)
    assert "--speed" in capsys.readouterr().err
