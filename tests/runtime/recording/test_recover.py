"""A recording cut off at any byte: all but its last second is readable, and `recover` makes a whole file of it."""

import asyncio
import random
import subprocess
import sys
import time
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from tests.runtime.recording.drives import PERIOD_S, Drive
from tests.runtime.recording.reading import decoded_by_ros2_support, scans_in, streamed
from wallride.runtime.recording.recover import RecoveryError, file_state, is_whole, recover

CUTS = 20


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Six seconds: unfinished, how long the file was after each turn of the recorder, and finished."""
    return asyncio.run(_record(tmp_path_factory.mktemp("recording")))


async def _record(folder):
    drive = Drive(folder, start="always")
    drive.permit()
    lengths = []
    for _ in range(60):
        await drive.go(0.1, write=False)
        drive.recorder.turn()
        path = next(folder.glob("*.mcap"))
        lengths.append((drive.clock.now_s, path.stat().st_size))
    content = path.read_bytes()
    drive.recorder.finish()
    return content, lengths, path.read_bytes()


def scans_due(content_length, lengths):
    """Return how many scans were made a second before the file had grown to that length."""
    now_s = max(now_s for now_s, length in lengths if length <= content_length)
    return int((now_s - 100.0 - 1.0) / PERIOD_S)


def test_cut_at_twenty_random_moments_everything_but_the_last_second_is_there(recording, tmp_path):
    content, lengths, _ = recording
    shuffled = random.Random(7)
    for number in range(CUTS):
        cut = content[: shuffled.randrange(lengths[12][1], len(content))]
        due = scans_due(len(cut), lengths)
        assert scans_in(cut) == list(range(len(scans_in(cut))))
        assert len(scans_in(cut)) >= due > 0
        path = tmp_path / f"{number}.mcap"
        path.write_bytes(cut)
        found = recover(path)
        assert not found.was_whole
        assert path.read_bytes()[: len(cut) - found.cut_bytes] == cut[: len(cut) - found.cut_bytes]
        assert scans_in(path.read_bytes())[: len(scans_in(cut))] == scans_in(cut)
        _is_sound(path, found.messages)


def test_cut_at_every_byte_near_a_chunk_s_end_it_can_be_finished(recording, tmp_path):
    content, _, _ = recording
    path = tmp_path / "cut.mcap"
    end = content.index(b"\x07", 400_000)
    for length in range(end - 40, end + 40, 3):
        path.write_bytes(content[:length])
        recover(path)
        _is_sound(path)


def _is_sound(path, messages=None):
    """See that the package's own reader is content: checksums, index, statistics and all."""
    content = path.read_bytes()
    assert is_whole(path)
    list(StreamReader(BytesIO(content), validate_crcs=True).records)
    reader = make_reader(BytesIO(content), validate_crcs=True)
    summary: Any = reader.get_summary()
    indexed = sum(1 for _ in reader.iter_messages())
    assert indexed == len(streamed(content)) == summary.statistics.message_count
    assert messages in {None, indexed}


def test_what_recover_writes_is_what_the_package_would_have_written(recording, tmp_path):
    content, _, finished = recording
    path = tmp_path / "cut.mcap"
    path.write_bytes(content)
    recover(path)
    assert decoded_by_ros2_support(path)["/scan"] == len(scans_in(content))
    path.write_bytes(finished[:-100])
    recover(path)
    ours: Any = make_reader(BytesIO(path.read_bytes())).get_summary()
    theirs: Any = make_reader(BytesIO(finished)).get_summary()
    assert ours.statistics == theirs.statistics
    assert ours.chunk_indexes == theirs.chunk_indexes
    assert (ours.channels, ours.schemas, ours.metadata_indexes) == (
        theirs.channels, theirs.schemas, theirs.metadata_indexes,
    )  # fmt: skip


def test_a_whole_file_is_left_as_it_is(recording, tmp_path):
    path = tmp_path / "whole.mcap"
    path.write_bytes(recording[2])
    assert recover(path).was_whole
    assert path.read_bytes() == recording[2]
    assert file_state(path) == "whole"


def test_zeros_at_the_end_as_a_file_system_leaves_them_are_cut_off(recording, tmp_path):
    content, _, _ = recording
    path = tmp_path / "zeros.mcap"
    path.write_bytes(content[:500_000] + bytes(70_000))
    assert file_state(path) == "unfinished"
    assert recover(path).cut_bytes >= 70_000
    _is_sound(path)


def test_a_damaged_chunk_in_the_middle_costs_only_itself(recording, tmp_path):
    content, _, _ = recording
    path = tmp_path / "damaged.mcap"
    spoilt = bytearray(content)
    spoilt[300_000] ^= 0xFF
    path.write_bytes(spoilt)
    found = recover(path)
    assert (recover(path).damaged, recover(path).was_whole) == (found.damaged, True) == (1, True)
    reader = make_reader(BytesIO(path.read_bytes()), validate_crcs=True)
    read = sum(1 for _ in reader.iter_messages())
    assert read == found.messages
    assert len(streamed(content)) - 400 < read < len(streamed(content))


def test_damage_far_from_the_end_is_not_cut_off(recording, tmp_path, monkeypatch):
    monkeypatch.setattr("wallride.runtime.recording.recover.MAX_TORN_B", 100_000)
    content = bytearray(recording[0])
    first_chunk = content.index(b"\x06", content.index(b"epoch_ns") + 28)
    content[first_chunk : first_chunk + 9] = bytes(9)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    with pytest.raises(RecoveryError, match="far from its end"):
        recover(path)
    assert path.read_bytes() == content


@pytest.mark.parametrize("content", [b"", b"\x89MCAP", b"ROSBAG V2.0\n", bytes(100)])
def test_what_is_no_recording_is_refused_and_left(tmp_path, content):
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(RecoveryError, match="not an MCAP file"):
        recover(path)
    assert path.read_bytes() == content


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(RecoveryError, match="No such file"):
        recover(tmp_path / "x.mcap")


async def test_a_file_that_is_being_written_is_left_alone(tmp_path):
    drive = Drive(tmp_path, start="always")
    drive.scan()
    drive.recorder.turn()
    path = next(tmp_path.glob("*.mcap"))
    assert file_state(path) == "recording"
    with pytest.raises(RecoveryError, match="being written"):
        recover(path)
    drive.recorder.finish()
    assert file_state(path) == "whole"


WRITER = Path(__file__).with_name("endless_drive.py")
ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("after_s", [1.7, 2.3])
def test_after_kill_9_all_but_the_last_second_is_readable(tmp_path, after_s):
    command = [sys.executable, str(WRITER), str(tmp_path)]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, text=True, env={"PYTHONPATH": str(ROOT)}
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "driving\n"
            time.sleep(after_s)
        finally:
            process.kill()
        made = [int(line) for line in process.stdout.read().split() if line.isdigit()]
    (path,) = tmp_path.glob("*.mcap")
    content = path.read_bytes()
    assert not is_whole(path)
    kept = scans_in(content)
    assert kept == list(range(len(kept)))
    assert len(kept) >= max(made) - 40, "40 scans are a second"
    recover(path)
    assert scans_in(path.read_bytes())[: len(kept)] == kept
    assert decoded_by_ros2_support(path)["/scan"] >= len(kept)
