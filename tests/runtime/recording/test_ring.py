"""The ring of recordings: what is kept, found by name, and deleted in order."""

import pytest

from runtime.recording.ring import Entry, file_named, in_order_of_leaving, keep


def test_a_kept_recording_is_kept_already(tmp_path):
    path = tmp_path / "20260101T000000Z-b0001-00001.mcap"
    path.touch()
    kept = keep(path)
    assert kept.is_file()
    assert keep(kept) == kept
    assert not path.exists()


def test_an_absolute_path_is_not_looked_for_elsewhere(tmp_path):
    (tmp_path / "run.mcap").touch()
    assert file_named(tmp_path / "other" / "run.mcap", tmp_path) is None
    assert file_named(tmp_path / "run.mcap", tmp_path / "other") == tmp_path / "run.mcap"


@pytest.mark.parametrize(("box_bytes", "first"), [(30, "box"), (3, "run")])
def test_black_boxes_leave_first_only_while_they_take_more_than_their_share(box_bytes, first):
    names = {"run": Entry("a", 1, 10, is_black_box=False, reason=""), "box": Entry("b", 2, box_bytes, True, "stop")}
    assert in_order_of_leaving(list(names.values()), 100)[0] == names[first]
