"""The summary in the terminal is for people; its JSON file has all digits."""

import asyncio
import io
import math
import pickle
import time
from argparse import Namespace
from collections.abc import Sequence
from typing import Any, Literal

import pytest
from rich.console import Console

from tests.runtime.control.line_following.lines import circle
from tests.sim.live.emulated import car, running
from tests.waiting import until
from wallride import cli
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.parameters.history import SettingChange
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.sim.car.vehicle import Vehicle, VehicleSettings
from wallride.sim.devices.vesc import MotorDemand
from wallride.sim.figures.summary import OF_THE_WALL, Sample
from wallride.sim.live import command, drive_summary
from wallride.sim.live.record import MAX_TRACK, Record, ThinnedTrack
from wallride.sim.live.session import SimulatorSession
from wallride.sim.racing.race import Race
from wallride.sim.world.pose import Pose


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
    assert "no source 0.16 s, navigation 9.8 s" in text
    assert "nobody" not in text
    assert set(winners) == {"nobody", "navigation"}, "the keys of the JSON file stay"
    assert "who decided │ -" in printed({"world": "loop", "winners": None})


def test_the_table_is_in_words_with_units_and_leaves_out_what_says_nothing():
    record = Record(1.0, telemetry={"status": {"output": None, "recording": {"file": "a.mcap", "words": "recording"}}})
    for step in range(300):
        record.note(Sample(0.1 * step, min(0.1 * step, 6.0), 0.0, 0.0, 1.0 if step < 60 else 0.0, 1.02, 0.5))
    record.sum_up(300)
    summary = {
        "world": "loop",
        **drive_summary.summarize(record, Settings()),
        "contacts": 0,
        "changed_while_driving": 0,
    }
    rows = [line.strip("│ ").split("│") for line in printed(summary).splitlines() if "│" in line]
    table = {label.strip(): words.strip() for label, words in rows}
    assert table["drove for"] == "29.9 s"
    assert table["stood in all"] == "23.9 s"
    assert table["mean distance error"] == "0.02 m"
    assert table["mean speed while moving"] == "1 m/s"
    assert not {"contacts", "changed while it drove", "telemetry", "recording", "session"} & set(table)
    assert not any("_" in label for label in table)


@pytest.mark.parametrize(
    ("recording", "words", "command", "failed"),
    [
        (
            {"file": "a.mcap", "words": "recording: armed", "is_open": True}, "recorded: a.mcap",
            "wallride report a.mcap", False,
        ),
        (  # a black box that the disk refused, beside a recording that goes on
            {"file": "a.mcap", "words": "NOT recording: the disk is full; trying again", "is_open": True},
            "recorded: a.mcap", "wallride report a.mcap", False,
        ),
        (
            {"file": "", "words": "NOT recording: less than 9 MB of the disk are free; trying again", "is_open": False},
            "nothing was recorded: less than 9 MB of the disk are free", "", True,
        ),
        (
            {"file": "", "words": "recording is turned off (recording.enabled)", "is_open": False},
            "nothing was recorded: recording is turned off (recording.enabled)", "", False,
        ),
        (
            {"file": "a.mcap", "words": "not recording: disarmed", "is_open": False},
            "recorded: a.mcap; not to the end: disarmed", "wallride report a.mcap", False,
        ),
        (
            {"file": "a.mcap", "words": "NOT recording: the disk is full; trying again", "is_open": False},
            "recorded: a.mcap; not to the end: the disk is full", "wallride report a.mcap", True,
        ),
        (None, "it is not known whether the drive was recorded: wallride logs", "", False),
    ],
)  # fmt: skip
def test_what_was_recorded_is_told_with_the_command_for_a_page(recording, words, command, failed):
    assert drive_summary.recorded_words(recording) == (words, command)
    assert drive_summary.failed_to_record(recording) is failed


def test_errors_are_from_the_distance_that_was_wanted_at_that_moment():
    samples = [Sample(0.1 * i, 0.1 * i, 0.0, 0.0, 1.0, 1.0 if i < 30 else 0.7, 0.5) for i in range(60)]
    change = SettingChange(1003.0, "", "ann", "wall_follow.desired_distance_m", 1.0, 0.7)
    other = SettingChange(1001.0, "", "ann", "wall_follow.kp", 13.5, 10.0)
    record = Record(1.0, began_s=1000.0, changes=[other, change])
    unchanged = Record(1.0)
    for sample in samples:
        record.note(sample)
        unchanged.note(sample)
    record.sum_up(20)
    record.sum_up(40)
    unchanged.sum_up(60)
    record.sum_up(len(record.fresh))
    assert record.sums.figures()["mean_abs_error_m"] == 0.0
    assert unchanged.sums.figures()["mean_abs_error_m"] == 0.15


@pytest.mark.parametrize(
    ("speed_mps", "said"), [(0.0, "safety: something on the lidar: uncover it, 0.30 m free"), (1.0, None)]
)
def test_the_summary_says_why_the_car_stands(speed_mps, said):
    samples = [Sample(0.1 * i, speed_mps * 0.1 * i, 0.0, 0.0, speed_mps, 1.0, 0.5) for i in range(30)]
    output = {"winner": "safety", "reason": "something on the lidar: uncover it", "measure": 0.3}
    record = Record(1.0, telemetry={"status": {"output": output}})
    for sample in samples:
        record.note(sample)
    record.sum_up(len(samples))
    assert drive_summary.summarize(record, Settings()).get("stands_because") == said


def test_the_summary_names_what_bounds_the_speed():
    bounds = ["the lidar allows 1.6 m/s: 8 Hz, 0.5 deg a beam, 12 m", "the motor allows 1.5 m/s: no command timeout"]
    told = [{"window": [bounds[0], "something on the lidar", bounds[1]]}, {"window": []}]
    summaries = [drive_summary.summarize(Record(1.0, telemetry={"status": one}), Settings()) for one in told]
    assert [one["speed_bounds"] for one in summaries] == [bounds, []]
    tables = [printed({"world": "loop", "speed_bounds": one["speed_bounds"]}) for one in summaries]
    assert ["bound of the speed" in text for text in tables] == [True, False]


def test_a_drive_of_days_takes_no_more_memory_than_one_of_minutes(monkeypatch):
    """Pickled sizes: what is kept grows until the track is full, and no further."""
    monkeypatch.setattr("wallride.sim.live.record.MAX_TRACK", 2000)
    record, sizes = Record(1.0), []
    for scan in range(4 * 2000 + 1):
        record.note(Sample(scan * 0.025, math.cos(scan), math.sin(scan), 0.0, 1.0, 1.0 + 0.1 * math.sin(scan), 0.5))
        record.latency.scan_sent(scan * 0.025)
        record.latency.command_received(scan * 0.025 + 0.0005 * (1 + scan % 3))
        if len(record.fresh) == 400:
            record.sum_up(400)
        if scan in {2 * 2000, 4 * 2000}:
            sizes.append(len(pickle.dumps(record)))
    assert sizes[1] < 1.05 * sizes[0]
    record.sum_up(len(record.fresh))
    assert record.sums.figures()["rms_error_m"] == pytest.approx(0.1 / math.sqrt(2), abs=1e-3)
    figures_ms = record.latency.summary_ms()
    assert figures_ms["p50"] == pytest.approx(1.0, rel=0.001)
    assert figures_ms["max"] == pytest.approx(1.5, rel=0.001)
    assert figures_ms["p99"] == pytest.approx(1.5, rel=0.001)


def test_a_thinned_track_keeps_its_beginning_and_even_steps():
    track = ThinnedTrack()
    for scan in range(3 * MAX_TRACK):
        track.add(Sample(float(scan), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    times = [sample.time_s for sample in track.samples]
    assert times == [4.0 * k for k in range(len(times))]
    assert len(times) > MAX_TRACK // 2


def test_a_computer_too_busy_to_be_a_car_is_named_and_not_the_car_blamed():
    record = Record(1.0)
    for late_s in (0.001, 0.02, 0.149):
        assert not record.held_up.note(late_s)
    assert drive_summary.summarize(record, Settings())["held_up"] == ""
    assert record.held_up.note(0.31)
    assert record.held_up.note(0.2)
    assert drive_summary.summarize(record, Settings())["held_up"] == (
        "this computer is too busy to be a car: it held the emulated devices up 2 times, for up to 0.31 s;"
        " a device that the car lost then was there"
    )
    assert "too busy to be a car" in printed({"world": "loop", "held_up": record.held_up.words})


async def test_emulate_tells_it_while_the_car_drives(tmp_path):
    said: list[str] = []
    one = car(tmp_path)
    one.tell_held_up = said.append
    async with running(one):
        await asyncio.sleep(0.1)
        time.sleep(0.4)  # what a computer with other work does to a process
        await until(lambda: said)
    assert said[0].startswith("this computer is too busy to be a car")


def test_a_race_has_no_figures_of_the_wall():
    others = [load_settings(None, [f"wall_follow.method={method}"]) for method in ("line", "corridor")]
    for one, wall in (*((other, False) for other in others), (Settings(), True)):
        told = drive_summary.summarize(Record(1.0), one)
        assert ({"mean_abs_error_m", "rms_error_m", "settle_s", "max_overshoot_m"} <= set(told)) is wall
        assert {"distance_m", "hard_stops"} <= set(told)


def test_a_brake_of_a_moving_car_is_a_hard_stop_until_the_drive_is_over():
    vehicle = Vehicle(VehicleSettings())
    vehicle.place(Pose(0.0, 0.0, 0.0), speed_mps=2.0)
    scene: Any = None
    session = SimulatorSession(scene, vehicle, VescSettings())
    kinds: Sequence[Literal["speed", "brake"]] = ("speed", "brake", "brake", "speed", "brake", "speed")
    for kind in kinds:
        session._on_command(0.0, MotorDemand(kind, 1.0))
    session._over = True
    session._on_command(0.0, MotorDemand("brake", 1.0))
    assert session.record.hard_stops == 2


def test_a_car_that_began_where_it_is_to_drive_has_nothing_to_settle():
    shown = [printed({"world": "loop", "settle_s": settle_s}) for settle_s in (0.0, 1.5, None)]
    assert ["within 5 cm after" in text for text in shown] == [False, True, True]
    assert "never" in shown[2]


AGAINST = "the race line goes the other way: along the wall"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"laps": 5}, ""),
        ({"laps": 2}, "2 of 5 laps in 300 s; more time: --duration"),
        ({"laps": 0, "hard_stops": 1, "collided": True}, "0 of 5 laps in 300 s; it touched something; 1 hard stop"),
        (
            {
                "laps": 1,
                "hard_stops": 3,
                "seconds_by_reason": {"race line": 90.0, "wall": 60.0, AGAINST: 140.4, "wall ahead": 0.3},
            },
            f"1 of 5 laps in 300 s; 3 hard stops; 140 s: {AGAINST}",
        ),
    ],
)
def test_why_laps_are_missing_is_told(changes, said):
    summary = {"laps": 0, "duration_s": 300.0, "collided": False, "hard_stops": 0, "seconds_by_reason": {}, **changes}
    assert drive_summary.laps_missing(summary, 5) == said
    assert drive_summary.laps_missing(summary, None) == ""


def test_a_race_says_how_long_it_raced_what_kept_it_and_that_the_map_is_of_another_place():
    reasons_s = {"race line": 3.04, "joining the race line": 2.0, "the pose is not known: along the wall": 14.9}
    raced, never = map(drive_summary.along_the_line, (reasons_s, {"wall": 9.0}))
    assert raced == {"raced_s": 3.04, "kept_by": ["15 s: the pose is not known: along the wall"]}
    assert never == {"raced_s": 0.0, "kept_by": []}
    out = io.StringIO()
    told = Console(file=out, width=200)
    summary: dict[str, Any] = {"world": "loop", **raced, "recording": None}
    command._show(summary, told, Race(circle(), notice="lab.yaml is the map of a lap in levine"), put_back=False)
    text = out.getvalue()
    assert "along the race line for │ 3.04 s" in text
    assert "kept from it │ 15 s: the pose is not known: along the wall" in " ".join(text.split())
    assert "wallride: lab.yaml is the map of a lap in levine" in text


@pytest.mark.parametrize(("laps", "code"), [(2, 1), (3, 0)])
def test_a_drive_of_fewer_laps_than_asked_for_has_failed(monkeypatch, capsys, laps, code):
    summary = {"world": "loop", "laps": laps, "duration_s": 40.0, "collided": False, "hard_stops": 2, "faults": {}}
    summary |= {"seconds_by_reason": {}, "recording": None, "telemetry": drive_summary.HEARD, "failed": ""}
    monkeypatch.setattr(command, "_drive", lambda *_, **__: summary)
    assert cli.main(["sim", "loop", "--laps", "3", "--headless"]) == code
    assert ("wallride: 2 of 3 laps in 40 s; 2 hard stops" in capsys.readouterr().err) is bool(code)


def test_a_world_without_a_lap_is_told_how_it_gets_one():
    maps, built_in = (command._instead_of_laps(Namespace(world=world, laps=3)) for world in ("levine.yaml", "dead_end"))
    assert built_in == "give --duration instead"
    assert "a lap is known only after one was driven and mapped: wallride map -o lab.yaml, wallride line" in maps
    assert maps.endswith("wallride sim --race lab.yaml --laps 3")


@pytest.mark.parametrize(("keep_mb", "is_said"), [(0, False), (10**9, True)])
def test_a_disk_without_room_for_a_recording_is_told_before_the_drive(tmp_path, keep_mb, is_said):
    out = io.StringIO()
    told = Console(file=out, width=200)
    chosen = [f"recording.folder={tmp_path / 'none'}", f"recording.keep_free_mb={keep_mb}"]
    command._say_first(told, tmp_path / "saved.toml", None, load_settings(None, chosen))
    said = f"wallride: nothing will be recorded: less than {keep_mb} MB of the disk are free\n"
    assert out.getvalue() == said * is_said


def test_a_law_or_side_that_was_changed_is_said_and_errors_from_two_walls_are_left_out():
    def changed(name, old, new, at_s=2.0):
        return SettingChange(at_s, "", "vera", f"wall_follow.{name}", old, new)

    changes = (changed("method", "ball", "report"), changed("kp", None, 1.5), changed("side", "left", "right", 3.0))
    summary = drive_summary.summarize(Record(1.0, changes=changes), Settings())
    assert (summary["method"], summary["side"]) == ("ball, then report", "left, then right")
    assert not OF_THE_WALL & set(summary)
    summary = drive_summary.summarize(Record(1.0, changes=changes[:2]), Settings())
    assert summary["side"] == "left"
    assert set(summary) >= OF_THE_WALL
