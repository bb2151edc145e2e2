"""When it records, and what is in the files."""

import json
import logging
import re
from collections import Counter
from functools import partial

import numpy as np
import pytest

from tests.runtime.observed import check_told
from tests.runtime.recording import drives
from tests.runtime.recording.drives import EPOCH_NS
from tests.runtime.recording.reading import decoded_by_ros2_support, events, metadata, streamed
from tests.runtime.recording.recorded import files, recordings
from tests.runtime.telemetry.test_course_messages import shown
from wallride.runtime.arbitration.command import Source, refusal
from wallride.runtime.control.localization.localizer import PoseEstimate, Whereabouts
from wallride.runtime.control.localization.wall_points import MapGrid
from wallride.runtime.recording.channels import text_of
from wallride.runtime.recording.recover import is_whole
from wallride.runtime.settings.tree import Settings, load_settings
from wallride.runtime.wire import topics
from wallride.sim.virtual.devices import ranges_between_walls

Drive = partial(drives.Drive, period_s=4 * drives.PERIOD_S)
driven = partial(drives.driven, period_s=4 * drives.PERIOD_S)
"""When it records is no matter of how many scans there are."""
WALL_AHEAD_M = ranges_between_walls(0.9, 1.1, 0.28)


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
    changed = Settings.model_validate({"wall_follow": {"speed_mps": 0.7}})
    drive = await driven(tmp_path, 1, black_box_s=2)
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
    drive = await driven(tmp_path, 2, start="always")
    drive.recorder.finish()
    (path,) = recordings(tmp_path)
    decoded = decoded_by_ros2_support(path)
    check_told({name[1:] for name in decoded} - {"tape", "settings"})
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


@pytest.mark.slow
async def test_a_map_is_once_in_each_file(tmp_path):
    drive = Drive(tmp_path, black_box_s=2)
    drive.telemetry.on_course(shown(grid=MapGrid(np.eye(9, dtype=np.int8), 0.05, 0j)))
    for _ in range(2):
        drive.permit()
        for _ in range(4):
            drive.telemetry.on_pose(PoseEstimate(drive.clock.now_s, Whereabouts.SEARCHING))
            await drive.go(1)
        drive.permit(False)
        await drive.go(15)
    drive.recorder.finish()
    paths = recordings(tmp_path)
    assert len(paths) == 2
    assert [decoded_by_ros2_support(path)["/map"] for path in paths] == [1, 1]
    begin_s, end_s = span_s(paths[1], topics.MAP)
    assert begin_s == end_s == pytest.approx(span_s(paths[1])[0], abs=0.1), "with the file's first messages"


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
    drive = await driven(tmp_path, 12, start="request", black_box_s=10)
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
    drive = await driven(tmp_path, 2)
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
    drive = await driven(tmp_path, 2)
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
    drive = await driven(tmp_path, 2)
    await drive.go(1, speak=False)
    (box,) = boxes(tmp_path)
    assert "stop-no-word-from-navigation" in box.name


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
