"""A recording tells the time: every reader finds the same beginning, length and rates, whatever began it."""

import json
import shutil
import sqlite3
from datetime import datetime
from typing import Any
from unittest import mock

import pytest
from mcap.reader import make_reader
from rosbags.convert.cli import main as rosbags_convert

from tests.runtime.observed import HandClock
from tests.runtime.recording.drives import EPOCH_NS, Drive
from tests.runtime.recording.reading import scans_in, streamed
from wallride.clients.log_info import describe
from wallride.runtime.arbitration.command import Source, refusal
from wallride.runtime.realtime.wall_clock import NS, WallClock, never_set
from wallride.runtime.recording.channels import text_of
from wallride.runtime.recording.recover import recover
from wallride.runtime.wire import topics
from wallride.sim.replay.drive_log import read_log
from wallride.sim.replay.run import run_of

DRIVEN_S = 4.0
YEAR_S = 365 * 86_400.0


async def always(drive):
    drive.permit()
    await drive.go(DRIVEN_S)


async def late_lidar(drive):
    """The first scan comes 0.4 s after the process began, as in the simulator."""
    drive.permit()
    await drive.go(0.4, speak=False)
    await drive.go(DRIVEN_S)


async def armed_later(drive):
    drive.permit(False)
    await drive.go(2)
    drive.permit()
    await drive.go(DRIVEN_S)


async def on_request(drive):
    drive.permit()
    await drive.go(3)
    drive.recorder.request(on=True)
    await drive.go(DRIVEN_S)


async def clock_set(drive):
    """NTP sets the clock of a computer that believed to be a year earlier."""
    drive.permit()
    await drive.go(DRIVEN_S)
    drive.clock_set_s = YEAR_S
    drive.wall_clock.follow()
    await drive.go(DRIVEN_S)


async def no_lidar(drive):
    drive.permit()
    await drive.go(5 + DRIVEN_S, speak=False)


async def stopped(drive):
    """An e-stop: a black box beside the recording."""
    drive.permit()
    await drive.go(2)
    drive.put(refusal(Source.ESTOP, "e-stop"))
    await drive.go(DRIVEN_S)


async def in_pieces(drive):
    drive.permit()
    await drive.go(8)  # a file has 5.8 s


async def torn(drive):
    """Power is cut: the file has no end and is finished later."""
    await always(drive)
    drive.torn = True


DRIVES: dict[str, tuple[Any, dict[str, Any]]] = {
    "always": (always, {"start": "always"}),
    "late lidar": (late_lidar, {"start": "always"}),
    "armed at once": (late_lidar, {"start": "armed"}),
    "armed later": (armed_later, {"start": "armed"}),
    "on request": (on_request, {"start": "request"}),
    "clock set": (clock_set, {"start": "always"}),
    "no lidar": (no_lidar, {"start": "always"}),
    "black box": (stopped, {"start": "always"}),
    "in pieces": (in_pieces, {"start": "always", "file_mb": 8}),
    "power cut": (torn, {"start": "always"}),
}


def by_mcap(path):
    """Return begin [s], length [s] and messages by topic as the package `mcap` reads them."""
    with path.open("rb") as file:
        summary: Any = make_reader(file).get_summary()
    found = summary.statistics
    counts = {summary.channels[number].topic: count for number, count in found.channel_message_counts.items()}
    return found.message_start_time / NS, (found.message_end_time - found.message_start_time) / NS, counts


def by_rosbags(path, folder):
    """Return the same as `rosbags-convert` makes of it."""
    folder = folder / f"{path.stem}-converted"
    typed = ["rosbags-convert", "--src", str(path), "--dst", str(folder)]
    with mock.patch("sys.argv", typed), pytest.raises(SystemExit) as ended:  # a program for each takes half a second
        rosbags_convert()
    assert not ended.value.code
    with sqlite3.connect(next(folder.glob("*.db3"))) as base:
        first_ns, last_ns = base.execute("SELECT MIN(timestamp), MAX(timestamp) FROM messages").fetchone()
        counts = dict(
            base.execute("SELECT name, COUNT(*) FROM messages JOIN topics ON topics.id = topic_id GROUP BY name")
        )
    base.close()
    shutil.rmtree(folder)
    return first_ns / NS, (last_ns - first_ns) / NS, counts


def by_info(path):
    """Return the same as `wallride logs info --json` says it."""
    fields = json.loads(describe(path, as_json=True))
    counts = {topic: found["messages"] for topic, found in fields["topics"].items()}
    return datetime.fromisoformat(fields["begins"]).timestamp(), fields["seconds"], counts


def by_report(path):
    """Return the same as the report shows it."""
    log = read_log(path)
    run = run_of(log)
    counts = {f"/{topic}": len(messages) for topic, messages in log.by_topic.items()}
    return datetime.fromisoformat(run.began.replace(" UTC", "+00:00")), run.duration_s, counts


@pytest.mark.parametrize("name", DRIVES)
async def test_every_reader_agrees_on_date_length_and_rates(tmp_path, monkeypatch, name):
    story, settings = DRIVES[name]
    if name == "in pieces":
        monkeypatch.setattr("wallride.runtime.recording.writer.MB", 200_000)
    folder = tmp_path / "recordings"
    drive = Drive(folder, **settings)
    await story(drive)
    if getattr(drive, "torn", False):
        (path,) = folder.glob("*.mcap")
        folder = tmp_path / "after"
        folder.mkdir()
        (folder / path.name).write_bytes(path.read_bytes()[:-3000])
        recover(folder / path.name)
    else:
        drive.recorder.finish()
    paths = sorted(folder.glob("*.mcap"))
    assert len(paths) == (2 if name in {"black box", "clock set", "in pieces"} else 1)
    for path in paths:
        begins_s, length_s, counts = by_mcap(path)
        assert length_s < 10, "no longer than the process ran"
        for again_s, again_length_s, again_counts in (by_rosbags(path, tmp_path), by_info(path)):
            assert again_s == pytest.approx(begins_s, abs=0.002)
            assert again_length_s == pytest.approx(length_s, rel=0.01)
            assert again_counts == counts
        began, report_s, report_counts = by_report(path)
        assert f"{began:%Y%m%dT%H%M}" == f"{datetime.fromtimestamp(begins_s, began.tzinfo):%Y%m%dT%H%M}"
        assert report_s == pytest.approx(length_s, rel=0.01)
        assert report_counts == counts
        if name == "no lidar":
            assert "/scan" not in counts
        else:
            assert counts["/scan"] / length_s == pytest.approx(40.0, rel=0.05)


async def test_it_begins_with_the_first_scan_and_keeps_what_was_before(tmp_path):
    drive = Drive(tmp_path, start="always")
    await late_lidar(drive)
    drive.recorder.finish()
    (path,) = tmp_path.glob("*.mcap")
    messages = [message for _, message in streamed(path.read_bytes())]
    first_scan_ns = EPOCH_NS + round(drive.scans[0].stamp_s * NS)
    assert min(message.log_time for message in messages) == first_scan_ns
    began_ns = EPOCH_NS + 100 * NS
    assert min(message.publish_time for message in messages) == began_ns, "the settings' own time is when they began"
    before = [message for message in messages if message.publish_time < first_scan_ns]
    assert len(before) > 5
    assert all(message.log_time == first_scan_ns for message in before)


async def test_a_step_of_the_clock_begins_another_file_and_is_marked_in_both(tmp_path):
    drive = Drive(tmp_path, start="always")
    await clock_set(drive)
    drive.recorder.finish()
    first, second = sorted(tmp_path.glob("*.mcap"), key=lambda path: path.name.split("-")[-1])
    found = [json.loads(describe(path, as_json=True)) for path in (first, second)]
    assert found[1]["continues"] == first.name
    for fields, begins_s in zip(found, (EPOCH_NS / NS + 100, EPOCH_NS / NS + 104 + YEAR_S), strict=True):
        assert datetime.fromisoformat(fields["begins"]).timestamp() == pytest.approx(begins_s, abs=0.3)
        assert fields["seconds"] == pytest.approx(DRIVEN_S, abs=0.3)
        assert fields["stops"] == []
    words = "the computer's clock was set by +31536000.000 s; stamps before it are off"
    marks = [step["reason"] for fields in found for step in fields["clock_steps"]]
    assert set(marks) == {words}
    assert words in describe(first, as_json=False)
    assert second.name[:4] == str(int(first.name[:4]) + 1), "the name has the right date"
    numbers = [number for path in (first, second) for number in scans_in(path.read_bytes())]
    assert numbers == list(range(len(drive.scans))), "no scan is lost or doubled at the step"
    headers = [
        int.from_bytes(message.data[4:8], "little")
        for topic, message in streamed(second.read_bytes())
        if topic == f"/{topics.ODOM}"
    ]
    assert headers[-1] == pytest.approx(EPOCH_NS / NS + 108 + YEAR_S, abs=1), "headers follow, too"
    assert any(
        json.loads(text_of(message.data))["event"] == "clock"
        for topic, message in streamed(first.read_bytes())
        if topic == "/events"
    )


def test_the_wall_clock_follows_steps_and_nothing_smaller():
    clock, offset = HandClock(50.0), [10**18]
    wall = WallClock(clock, lambda: offset[0] + round(clock.now_s * NS))
    clock.now_s += 100
    assert wall.follow() == 0
    offset[0] += 5_000_000
    assert wall.follow() == 0, "5 ms is a moment in which the process did not run"
    offset[0] -= NS
    assert wall.follow() == pytest.approx(-NS + 5_000_000)
    assert wall.unix_ns(clock.now_s) == offset[0] + round(clock.now_s * NS)
    assert wall.started_unix_ns(clock.now_s) == 10**18 + round(clock.now_s * NS)
    assert wall.follow() == 0


def test_a_clock_that_runs_faster_than_the_computers_is_never_set():
    clock = HandClock(0.0)
    wall = never_set(clock)
    for _ in range(5):
        clock.now_s += 1000.0
        assert wall.follow() == 0
