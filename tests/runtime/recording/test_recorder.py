"""When it records, what is in the files, and what happens when the disk does not want them."""

import errno
import itertools
import json
import logging
import re
import time
from collections import Counter

import pytest

from runtime.arbitration.command import Source, refusal
from runtime.recording.channels import text_of
from runtime.recording.recover import is_whole
from runtime.recording.ring import entries, parse
from runtime.ros.definitions import TYPES
from runtime.settings.tree import Settings, load_settings
from runtime.wire import topics
from sim.virtual.devices import ranges_between_walls
from tests.promises import promise
from tests.runtime.recording.disks import BadDisk, SlowDisk, StuckDisk
from tests.runtime.recording.drives import EPOCH_NS, Drive
from tests.runtime.recording.reading import decoded_by_ros2_support, events, metadata, streamed

WALL_AHEAD_M = ranges_between_walls(0.9, 1.1, 0.28)


def files(folder, pattern="*.mcap"):
    return sorted(folder.glob(pattern), key=number_of)


def number_of(path):
    found = parse(path.name)
    assert found is not None
    return found[0]


def recordings(folder):
    return [path for path in files(folder) if "-stop" not in path.name]


def boxes(folder):
    return [path for path in files(folder) if "-stop" in path.name]


def texts(path, topic):
    return [text_of(message.data).decode() for name, message in streamed(path.read_bytes()) if name == f"/{topic}"]


def span_s(path, topic=topics.SCAN):
    stamps = [message.log_time for name, message in streamed(path.read_bytes()) if name == f"/{topic}"]
    return min(stamps) / 1e9 - EPOCH_NS / 1e9, max(stamps) / 1e9 - EPOCH_NS / 1e9


async def test_it_records_from_arming_until_ten_seconds_after_and_keeps_the_time_before(tmp_path):
    drive = Drive(tmp_path)
    drive.permit(False)
    await drive.go(3)
    assert recordings(tmp_path) == []
    assert drive.recorder.status()["words"] == "not recording: disarmed"
    drive.permit()
    await drive.go(2)
    (path,) = recordings(tmp_path)
    assert drive.recorder.status()["words"] == "recording: armed"
    assert drive.recorder.status()["file"] == path.name
    drive.permit(False)
    await drive.go(9.5)
    assert not is_whole(path)
    await drive.go(1)
    assert is_whole(path)
    assert drive.recorder.status()["on"] is False
    begins_s, ends_s = span_s(path)
    assert begins_s == pytest.approx(100.0, abs=0.05)
    assert ends_s == pytest.approx(115.1, abs=0.3)
    await drive.go(5)
    assert recordings(tmp_path) == [path]


async def test_the_next_drive_has_a_file_of_its_own_with_settings_in_force(tmp_path):
    drive = Drive(tmp_path, black_box_s=2)
    changed = Settings.model_validate({"wall_follow": {"speed_mps": 0.7}})
    drive.permit()
    await drive.go(1)
    drive.decision_log.add_settings(changed)
    drive.permit(False)
    await drive.go(15)
    drive.permit()
    await drive.go(1)
    drive.recorder.finish()
    first, second = recordings(tmp_path)
    assert len(texts(first, "settings")) == 2
    (toml,) = texts(second, "settings")
    (tmp_path / "car.toml").write_text(toml)
    assert load_settings(tmp_path / "car.toml") == changed
    settings = [event.settings for event in events(second.read_bytes()) if hasattr(event, "settings")]
    assert [Settings.model_validate(values) for values in settings] == [changed]


async def test_everything_that_telemetry_says_is_in_it_for_every_reader(tmp_path):
    drive = Drive(tmp_path, start="always")
    drive.permit()
    await drive.go(2)
    drive.recorder.finish()
    (path,) = recordings(tmp_path)
    decoded = decoded_by_ros2_support(path)
    silent = {topics.TELEOP, topics.IMU}
    told = {*TYPES, *topics.JSON_TOPICS} - silent
    assert set(decoded) == {f"/{topic}" for topic in told} | {"/tape", "/settings"}
    assert decoded["/scan"] == len(drive.scans)
    assert decoded["/output"] == decoded["/distance_error"] >= len(drive.scans) - 1, "the last waits for its burst"
    assert 3 <= decoded["/status"] <= 5
    assert Counter(name for name, _ in streamed(path.read_bytes())) == decoded
    assert json.loads(texts(path, "status")[-1])["car"] == "car1"
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        scans = [reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()
                 if connection.topic == "/scan"]  # fmt: skip
    assert len(scans) == len(drive.scans)
    facts = metadata(path.read_bytes())
    assert (facts["car"], facts["version"], facts["epoch_ns"]) == ("car1", "9.9", str(EPOCH_NS))


async def test_somebody_may_begin_and_end_a_recording_by_hand(tmp_path):
    drive = Drive(tmp_path)
    drive.permit(False)
    await drive.go(1)
    drive.recorder.request(on=True)
    await drive.go(13)
    assert drive.recorder.status()["words"] == "recording: asked for"
    drive.recorder.request(on=False)
    await drive.go(0.3)
    assert drive.recorder.status()["on"] is False
    drive.permit()
    await drive.go(1)
    assert drive.recorder.status()["words"] == "recording: armed"
    drive.recorder.request(on=False)
    await drive.go(1)
    assert drive.recorder.status()["words"] == "not recording: asked not to"
    drive.permit(False)
    await drive.go(12)
    drive.permit()
    await drive.go(1)
    assert drive.recorder.status()["words"] == "recording: armed"


async def test_a_stop_leaves_a_black_box_also_when_nothing_is_recorded(tmp_path):
    drive = Drive(tmp_path, start="request", black_box_s=10)
    drive.permit()
    await drive.go(12)
    assert files(tmp_path) == []
    await drive.go(0.5, ranges_m=WALL_AHEAD_M)
    (box,) = boxes(tmp_path)
    assert re.search(r"-stop-braking-wall-ahead\.mcap$", box.name), box.name
    assert drive.recorder.status()["black_box"] == box.name
    await drive.go(6)
    assert is_whole(box)
    begins_s, ends_s = span_s(box)
    assert begins_s == pytest.approx(112.1 - 10, abs=0.5)
    assert ends_s == pytest.approx(112.3 + 5, abs=0.5)
    (event,) = texts(box, "events")
    assert json.loads(event)["reason"] == "braking: wall ahead"
    assert metadata(box.read_bytes())["kind"] == "black box"
    assert len(texts(box, "settings")) == 1


async def test_an_emergency_stop_leaves_a_black_box_and_a_second_one_soon_after_goes_into_it(tmp_path):
    drive = Drive(tmp_path)
    drive.permit()
    await drive.go(2)
    drive.put(refusal(Source.ESTOP, "e-stop by ann"))
    await drive.go(1)
    drive.queue.withdraw(Source.ESTOP)
    await drive.go(1)
    drive.put(refusal(Source.ESTOP, "motor fault: over voltage"))
    await drive.go(10)
    (box,) = boxes(tmp_path)
    assert "stop-e-stop-by-ann" in box.name
    assert [json.loads(event)["reason"] for event in texts(box, "events")] == [
        "e-stop by ann", "motor fault: over voltage",
    ]  # fmt: skip
    (run,) = recordings(tmp_path)
    assert len(texts(run, "events")) == 2


async def test_letting_go_is_no_event_but_a_lost_motor_is(tmp_path):
    drive = Drive(tmp_path)
    drive.permit()
    await drive.go(2)
    drive.permit(False)
    await drive.go(2)
    assert boxes(tmp_path) == []
    drive.permit()
    await drive.go(2)
    drive.motor.present = False
    await drive.go(1)
    (box,) = boxes(tmp_path)
    assert "stop-the-motor-takes-no-commands" in box.name


async def test_a_lost_lidar_is_an_event(tmp_path):
    drive = Drive(tmp_path)
    drive.permit()
    await drive.go(2)
    await drive.go(1, speak=False)
    (box,) = boxes(tmp_path)
    assert "stop-no-word-from-navigation" in box.name


async def test_a_long_recording_goes_on_in_another_file_and_the_ring_lets_its_beginning_go(tmp_path, monkeypatch):
    monkeypatch.setattr("runtime.recording.ring.MB", 100_000)
    monkeypatch.setattr("runtime.recording.writer.MB", 100_000)
    drive = Drive(tmp_path, ring_mb=32, file_mb=8, start="always")
    drive.permit()
    await drive.go(24)
    drive.recorder.finish()
    total_mb = sum(path.stat().st_size for path in files(tmp_path)) / 1e6
    assert 2 < total_mb < 3.2 + 5 * 0.4  # the ring is looked after every few seconds
    left = recordings(tmp_path)
    numbers = [entry.number for entry in entries(tmp_path)]
    assert numbers[0] > 1
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    for earlier, later in itertools.pairwise(left):
        assert metadata(later.read_bytes())["continues"] == earlier.name
    taped = [event.number for path in left for event in events(path.read_bytes()) if not hasattr(event, "settings")]
    assert all(later - earlier == 1 for earlier, later in itertools.pairwise(taped)), "a split loses nothing"
    sequences = [message.sequence for path in left for name, message in streamed(path.read_bytes()) if name == "/scan"]
    assert sequences == list(range(sequences[0], len(drive.scans)))


@pytest.mark.parametrize(
    ("number", "words"),
    [(errno.ENOSPC, "the disk is full"), (errno.EROFS, "read-only"), (errno.EIO, "fails to write")],
)
async def test_a_disk_that_refuses_is_said_and_recording_goes_on_where_it_ended(tmp_path, number, words):
    disk = BadDisk()
    drive = Drive(tmp_path, disk=disk, start="always")
    drive.permit()
    await drive.go(3)
    disk.failing = disk.failing_creates = number
    sent = len(drive.motor.wire)
    await drive.go(12)
    assert len(drive.motor.wire) - sent == pytest.approx(12 * 40, abs=2), "the car drove on"
    assert words in drive.recorder.status()["words"]
    assert drive.recorder.status()["words"].startswith("NOT recording")
    assert drive.recorder.status()["on"] is False
    disk.failing = disk.failing_creates = None
    await drive.go(8)
    assert drive.recorder.status()["words"] == "recording: always"
    drive.recorder.finish()
    first, second = recordings(tmp_path)
    assert metadata(second.read_bytes())["continues"] == first.name
    numbers = [event.number for path in (first, second) for event in events(path.read_bytes())]
    assert set(range(max(numbers) + 1)) == set(numbers), "what was not written was still in memory"


async def test_a_disk_that_is_full_after_so_many_bytes_leaves_readable_files(tmp_path):
    disk = BadDisk()
    disk.takes_bytes = 700_001
    disk.short = True
    drive = Drive(tmp_path, disk=disk, start="always")
    drive.permit()
    await drive.go(8)
    assert "the disk is full" in drive.recorder.status()["words"]
    (path,) = recordings(tmp_path)
    assert path.stat().st_size > 650_000
    assert len(events(path.read_bytes())) > 100
    disk.takes_bytes = None
    await drive.go(6)
    assert drive.recorder.status()["on"] is True


async def test_others_keep_their_share_of_the_disk(tmp_path):
    disk = BadDisk()
    disk.free = 100_000_000
    drive = Drive(tmp_path, disk=disk, start="always", keep_free_mb=512)
    drive.permit()
    await drive.go(1)
    assert files(tmp_path) == []
    assert drive.recorder.status()["words"] == "NOT recording: less than 512 MB of the disk are free; trying again"
    disk.free = 10**12
    await drive.go(6)
    assert drive.recorder.status()["on"] is True
    disk.free = 100_000_000
    await drive.go(6)
    assert drive.recorder.status()["on"] is False
    assert all(is_whole(path) for path in files(tmp_path))


async def test_what_was_torn_is_finished_at_the_next_start(tmp_path):
    drive = Drive(tmp_path, start="always")
    drive.permit()
    await drive.go(3)
    (path,) = recordings(tmp_path)
    torn = path.read_bytes()
    drive.recorder.finish()
    path.write_bytes(torn)  # as a killed process leaves it
    (tmp_path / "20260101T000000Z-b0001-00007.mcap").touch()
    again = Drive(tmp_path, start="request")
    again.permit(False)
    await again.go(6)
    await again.go(6)
    assert is_whole(path)
    assert path.read_bytes().startswith(torn[:-60_000])
    assert files(tmp_path) == [path], "an empty file goes"


async def test_a_number_is_never_given_twice(tmp_path):
    for number in (1, 2, 3):
        drive = Drive(tmp_path, start="always")
        drive.scan()
        drive.recorder.turn()
        drive.recorder.turn()
        drive.recorder.finish()
        (path,) = recordings(tmp_path)
        assert number_of(path) == number
        path.unlink()


async def test_a_recorder_that_is_off_does_nothing(tmp_path):
    drive = Drive(tmp_path, enabled=False)
    drive.permit()
    drive.recorder.start()
    await drive.go(2, write=False)
    drive.recorder.close()
    assert list(tmp_path.iterdir()) == []
    assert drive.decision_log.drain() == []
    assert "turned off" in drive.recorder.status()["words"]
    assert not any(drive.recorder.claim(topic, 100.0) for topic in (topics.OUTPUT, topics.STATUS))


async def test_raw_bytes_and_log_lines_are_recorded(tmp_path):
    drive = Drive(tmp_path, start="always", raw=True)
    drive.recorder.start()
    tap = drive.recorder.tap("lidar")
    assert tap is not None
    tap("in", b"\x00\xff02", 100.5)
    logging.getLogger("wallride.test").warning("the %s is loose", "cable")
    drive.recorder.close(5)
    (path,) = recordings(tmp_path)
    found = dict(streamed(path.read_bytes()))
    assert found["/raw/lidar/in"].data.endswith(b"\x00\xff02")
    assert found["/raw/lidar/in"].log_time == EPOCH_NS + 100_500_000_000
    assert "the cable is loose" in "".join(texts(path, "log"))
    assert decoded_by_ros2_support(path)["/raw/lidar/in"] == 1


def test_raw_bytes_are_only_recorded_on_request(tmp_path):
    assert Drive(tmp_path).recorder.tap("lidar") is None
    assert Drive(tmp_path, raw=True, enabled=False).recorder.tap("lidar") is None


def until(true, timeout_s=10.0):
    give_up_s = time.monotonic() + timeout_s
    while not true():
        assert time.monotonic() < give_up_s
        time.sleep(0.01)


async def test_a_stuck_disk_holds_nobody_up_and_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr("runtime.recording.recorder.MAX_WAITING_BYTES", 300_000)
    disk = StuckDisk()
    drive = Drive(tmp_path, disk=disk, start="always")
    drive.permit()
    drive.scan()
    drive.recorder.start()
    disk.lets_go.clear()
    until(disk.asked.is_set)
    started_s = time.perf_counter()
    for _ in range(40):
        await drive.go(0.25, write=False)
    took_s = time.perf_counter() - started_s
    status = drive.recorder.status()
    assert re.match(r"NOT recording: the disk has not answered for \d+ s; [1-9]\d* messages lost", status["words"])
    disk.lets_go.set()
    until(lambda: drive.recorder.status()["words"].startswith("the disk is too slow"))
    drive.clock.now_s += 11
    await drive.go(0.25, write=False)
    until(lambda: drive.recorder.status()["words"] == "recording: always")
    drive.recorder.close(10)
    (path,) = recordings(tmp_path)
    assert is_whole(path)
    promise("400 scans with a stuck disk", took_s, 8.0)


async def test_a_disk_of_one_megabyte_a_second_is_fast_enough(tmp_path):
    drive = Drive(tmp_path, disk=SlowDisk(1e6), start="always")
    drive.permit()
    drive.recorder.start()
    started_s = time.perf_counter()
    await drive.go(4, write=False)
    took_s = time.perf_counter() - started_s
    until(lambda: drive.recorder.status()["written_mb"] > 0.9)
    drive.recorder.close(10)
    (path,) = recordings(tmp_path)
    assert path.stat().st_size < 4e6 / 2, "what is recorded in a second is half of what the disk takes"
    assert drive.recorder.status()["lost"] == 0
    assert [m.sequence for topic, m in streamed(path.read_bytes()) if topic == "/scan"] == list(range(160))
    promise("160 scans with a slow disk", took_s, 3.0)


async def test_a_disk_that_never_answers_does_not_keep_the_process(tmp_path):
    disk = StuckDisk()
    drive = Drive(tmp_path, disk=disk, start="always")
    drive.scan()
    drive.recorder.start()
    disk.lets_go.clear()
    until(disk.asked.is_set)
    started_s = time.perf_counter()
    drive.recorder.close(0.2)
    took_s = time.perf_counter() - started_s
    disk.lets_go.set()
    drive.recorder.close(5)
    promise("closing with a stuck disk", took_s, 1.0)


async def test_a_bug_in_the_thread_is_said(tmp_path, monkeypatch, caplog):
    drive = Drive(tmp_path, start="always")
    monkeypatch.setattr("runtime.recording.writer.RecordingWriter.turn", lambda *_: 1 / 0)
    drive.recorder.start()
    drive.recorder.close(5)
    assert drive.recorder.status()["words"] == "NOT recording: the recorder failed: ZeroDivisionError: division by zero"
    assert "the car drives on without it" in caplog.text
