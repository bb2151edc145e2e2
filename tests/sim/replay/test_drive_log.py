"""Our own recordings, whole, cut off anywhere, and damaged in the middle."""

import json

import pytest

from wallride.runtime.wire import topics
from wallride.sim.recordings import RecordingError
from wallride.sim.replay.drive_log import decode, is_mcap, read_log


def test_a_whole_file_holds_what_was_recorded(dead_end):
    log = read_log(dead_end)
    assert log.is_ours
    assert not log.notes
    assert log.fact("car") == "car1"
    assert len(log.of(topics.SCAN)) == 360
    assert decode(log.of(topics.SCAN)[0]).ranges.size == 1081
    assert "[wall_follow]" in log.settings_text
    statuses = list(log.json(topics.STATUS))
    assert statuses[-1][1]["car"] == "car1"
    assert all(message.schema == "" and json.loads(message.payload) for message in log.of(topics.STATUS))


def test_a_file_that_was_cut_off_anywhere_holds_everything_before(dead_end, tmp_path):
    content, whole = dead_end.read_bytes(), read_log(dead_end)
    cut = tmp_path / "cut.mcap"
    counts = []
    for share in (0.2, 0.41, 0.63, 0.85, 0.97):
        cut.write_bytes(content[: round(share * len(content))])
        log = read_log(cut)
        assert log.messages == whole.messages[: len(log.messages)]
        assert "messages were saved" in log.notes[0]
        counts.append(len(log.messages))
    assert counts == sorted(counts)
    assert counts[2] > 0.5 * len(whole.messages)


def test_one_broken_byte_costs_one_chunk_and_is_said(dead_end, tmp_path):
    content, whole = bytearray(dead_end.read_bytes()), read_log(dead_end)
    content[len(content) // 2] ^= 0xFF
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(content)
    log = read_log(broken)
    kept = set(log.messages)
    lost = [message for message in whole.messages if message not in kept]
    assert 0 < len(lost) < 200
    assert sum(len(message.payload) for message in lost) < 64 << 10
    assert kept <= set(whole.messages)
    assert "1 damaged pieces are left out" in log.notes[0]


def test_the_first_chunk_s_types_are_known_from_the_end_of_a_whole_file(dead_end, tmp_path):
    """One flipped bit in it, which declares the topics, else cost the whole recording."""
    content = bytearray(dead_end.read_bytes())
    content[content.index(b"ros2msg")] ^= 0x01
    broken, cut = tmp_path / "broken.mcap", tmp_path / "cut.mcap"
    broken.write_bytes(content)
    cut.write_bytes(content[:-200])
    whole, log = read_log(dead_end), read_log(broken)
    assert set(log.messages) <= set(whole.messages)
    assert len(log.messages) > 0.9 * len(whole.messages)
    assert "1 damaged pieces are left out" in log.notes[0]
    assert {message.schema for message in read_log(cut).messages} <= {message.schema for message in whole.messages}


def test_a_file_with_nothing_whole_is_refused(dead_end, tmp_path):
    stub = tmp_path / "stub.mcap"
    stub.write_bytes(dead_end.read_bytes()[:600])
    with pytest.raises(RecordingError, match="holds no message"):
        read_log(stub)


def test_what_is_no_mcap_file_is_told_apart(dead_end, carried_bag, tmp_path):
    assert is_mcap(dead_end)
    assert not is_mcap(carried_bag)
    assert not is_mcap(tmp_path)
    with pytest.raises(RecordingError, match="cannot be opened"):
        is_mcap(tmp_path / "nowhere.mcap")
