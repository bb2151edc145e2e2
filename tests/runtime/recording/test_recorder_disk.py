"""The recorder and a disk that is full, slow, stuck or torn."""

import errno
import itertools
import os
import re
import time
from pathlib import Path

import pytest

from tests.promises import promise
from tests.runtime.recording.disks import BadDisk, SlowDisk, StuckDisk
from tests.runtime.recording.drives import PERIOD_S, Drive, driven
from tests.runtime.recording.reading import events, metadata, scans_in
from tests.runtime.recording.recorded import files, number_of, recordings
from wallride.runtime.arbitration.command import Source, refusal
from wallride.runtime.recording.recover import is_whole
from wallride.runtime.recording.ring import entries
from wallride.runtime.recording.writer import HOLD_S

SELDOM_S = 4 * PERIOD_S
"""From scan to scan, where it is no matter of how many there are."""


@pytest.mark.parametrize("file_mb", [8, 256])
async def test_a_long_recording_goes_on_in_another_file_and_the_ring_lets_its_beginning_go(
    tmp_path, monkeypatch, file_mb
):
    monkeypatch.setattr("wallride.runtime.recording.ring.MB", 100_000)
    monkeypatch.setattr("wallride.runtime.recording.writer.MB", 100_000)
    drive = await driven(tmp_path, 24, ring_mb=32, file_mb=file_mb, start="always")
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
    sequences = [number for path in left for number in scans_in(path.read_bytes())]
    assert sequences == list(range(sequences[0], len(drive.scans)))


@pytest.mark.parametrize(
    ("number", "words"), [(errno.ENOSPC, "the disk is full"), (errno.EROFS, "read-only"), (errno.EIO, "fails to write")]
)
async def test_a_disk_that_refuses_is_said_and_recording_goes_on_where_it_ended(tmp_path, number, words):
    disk = BadDisk()
    drive = await driven(tmp_path, 3, disk=disk, start="always", period_s=SELDOM_S)
    disk.failing = disk.failing_creates = number
    sent = len(drive.motor.wire)
    await drive.go(12)
    assert len(drive.motor.wire) - sent == pytest.approx(12 / SELDOM_S, abs=2), "the car drove on"
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


@pytest.mark.parametrize("fault", [{"failing": errno.ENOSPC}, {"takes_bytes": 0}], ids=["its folder", "its bytes"])
async def test_a_black_box_of_which_the_disk_takes_nothing_leaves_no_file(tmp_path, fault):
    disk = BadDisk()
    drive = await driven(tmp_path, 2, disk=disk, start="request")
    vars(disk).update(fault)
    drive.put(refusal(Source.ESTOP, "e-stop by ann"))
    await drive.go(1)
    assert "the disk is full" in drive.recorder.status()["words"]
    assert files(tmp_path) == []


async def test_a_disk_that_is_full_after_so_many_bytes_leaves_readable_files(tmp_path):
    disk = BadDisk()
    disk.takes_bytes, disk.short = 700_001, True
    drive = await driven(tmp_path, 8, disk=disk, start="always")
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
    drive = await driven(tmp_path, 1, disk=disk, start="always", keep_free_mb=512, period_s=SELDOM_S)
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
    drive = await driven(tmp_path, 3, start="always")
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


def until(true, timeout_s=10.0):
    give_up_s = time.monotonic() + timeout_s
    while not true():
        assert time.monotonic() < give_up_s
        time.sleep(0.01)


async def test_a_stuck_disk_holds_nobody_up_and_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr("wallride.runtime.recording.recorder.MAX_WAITING_BYTES", 300_000)
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
    assert scans_in(path.read_bytes()) == list(range(160))
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


async def test_a_bug_in_the_thread_is_said_and_the_next_turn_tries_again(tmp_path, monkeypatch, caplog):
    drive = Drive(tmp_path, start="always")
    words = lambda: drive.recorder.status()["words"]  # noqa: E731 - as short as a name
    with monkeypatch.context() as broken:
        broken.setattr("wallride.runtime.recording.writer.RecordingWriter.turn", lambda *_: 1 / 0)
        drive.recorder.start()
        until(lambda: "trying again" in words())
        assert words().startswith("NOT recording: the recorder failed: ZeroDivisionError: division by zero; trying")
        assert caplog.text.count("the car drives on, and it tries again") == 1
    until(lambda: not words().startswith("NOT"))
    drive.recorder.close(5)


@pytest.mark.parametrize("harm", [Path.unlink, lambda path: os.truncate(path, 1000)])
async def test_an_open_recording_and_black_box_that_another_program_takes_begin_anew(tmp_path, caplog, harm):
    drive = await driven(tmp_path, 2, start="always")
    drive.put(refusal(Source.ESTOP, "e-stop by ann"))
    await drive.go(1)
    lost = files(tmp_path)
    for path in lost:
        harm(path)
    await drive.go(6)
    run, box = (next(path for path in files(tmp_path) if path not in lost and ("-stop" in path.name) is is_box)
                for is_box in (False, True))  # fmt: skip
    assert drive.recorder.status()["file"] == run.name
    drive.recorder.finish()
    assert "deleted, moved or changed by another program" in caplog.text
    assert len(lost) == 2
    assert is_whole(box)
    assert "-stop-e-stop-by-ann" in box.name
    assert metadata(run.read_bytes())["continues"] == ""
    assert scans_in(run.read_bytes()) == list(range(len(drive.scans))), "what was remembered is in the new file"


async def test_starts_and_stops_in_quick_turn_go_into_one_file_and_nothing_is_written_twice(tmp_path):
    drive = await driven(tmp_path, 8, start="request", period_s=2 * PERIOD_S)
    for turn in range(20):
        drive.recorder.request(on=turn % 2 == 0)
        await drive.go(0.1)
    await drive.go(HOLD_S + 0.2)
    assert drive.recorder.status()["on"] is False
    first, second = recordings(tmp_path)
    assert is_whole(second)
    assert metadata(second.read_bytes())["continues"] == first.name
    scans = [scans_in(path.read_bytes()) for path in (first, second)]
    assert sorted({*scans[0], *scans[1]}) == sorted([*scans[0], *scans[1]])
    assert [*scans[0], *scans[1]] == list(range(scans[1][-1] + 1)), "none is missing, either"
    assert len(drive.scans) - scans[1][-1] > 10, "after the last stop it does not go on"
    await drive.go(31)
    drive.recorder.request(on=True)
    await drive.go(1)
    assert metadata(recordings(tmp_path)[-1].read_bytes())["continues"] == "", "too late to go on"
