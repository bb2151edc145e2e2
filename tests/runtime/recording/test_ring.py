"""The ring of recordings: what is kept, found by name, and deleted in order."""

import fcntl
import os
from pathlib import Path
from typing import Any

import pytest

from wallride.runtime.recording.disk import Disk
from wallride.runtime.recording.ring import (
    MB,
    Entry,
    Ring,
    entries,
    file_named,
    folders,
    in_order_of_leaving,
    parse,
)
from wallride.runtime.settings.recording import RecordingSettings


def test_an_absolute_path_is_not_looked_for_elsewhere(tmp_path):
    (tmp_path / "run.mcap").touch()
    assert file_named(tmp_path / "other" / "run.mcap", tmp_path) is None
    assert file_named(tmp_path / "run.mcap", tmp_path / "other") == tmp_path / "run.mcap"


def test_the_ending_of_a_recording_may_be_left_out(tmp_path, monkeypatch):
    (tmp_path / "sim").mkdir()
    run = tmp_path / "sim" / "20260101T000000Z-b0001-00001.mcap"
    run.touch()
    assert file_named(Path(run.stem), tmp_path) == run
    assert file_named(run.with_suffix(""), tmp_path) == run
    assert file_named(Path("sim") / run.stem, tmp_path) == run
    monkeypatch.chdir(tmp_path / "sim")
    assert file_named(Path(run.stem), tmp_path / "other") == Path(run.name)
    assert file_named(Path(), tmp_path) is None


@pytest.mark.parametrize(("box_bytes", "order"), [(30, "bac"), (3, "abc")])
def test_black_boxes_leave_first_only_while_they_take_more_than_their_share_and_never_the_newest(box_bytes, order):
    run = Entry("a", 1, 10, is_black_box=False, reason="")
    boxes = [Entry(name, number, box_bytes, True, "stop") for number, name in enumerate("bc", 2)]
    assert "".join(entry.name for entry in in_order_of_leaving([run, *boxes], 100)) == order


class Odd:
    """A ring of three files of 10 MB, limited to 16, whose oldest entry cannot be opened or deleted."""

    def __init__(self, folder, kind):
        self.folder, self.kind = folder, kind
        self.paths = [folder / f"20260101T000000Z-b0001-0000{number}.mcap" for number in (1, 2, 3)]
        for path in self.paths:
            path.write_bytes(bytes(10 * MB))
        self.odd = self.paths[0]
        if kind != "refused":
            self.odd.unlink()
        if kind == "folder":
            (self.odd / "inside").mkdir(parents=True)
        elif kind == "pipe":
            os.mkfifo(self.odd)
        disk: Any = self
        self.ring = Ring(folder, RecordingSettings(ring_mb=16, keep_free_mb=0), disk, "boot")

    def remove(self, path):
        if path == self.odd and self.kind == "refused":
            raise PermissionError(1, "Operation not permitted")
        path.unlink()

    def free_bytes(self, _):
        return 10**12


@pytest.mark.parametrize("kind", ["refused", "folder", "pipe"])
def test_an_odd_entry_is_skipped_and_named_once_and_the_next_one_goes(tmp_path, caplog, kind):
    odd = Odd(tmp_path, kind)
    for _ in range(3):
        assert odd.ring.make_room()
    assert [path.exists() for path in odd.paths] == [True, False, True]
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert f"{odd.odd.name}: cannot be deleted for room" in caplog.text
    (tmp_path / odd.paths[2].name.replace("00003", "00004")).write_bytes(bytes(10 * MB))
    odd.ring.make_room()
    assert len(caplog.records) == 1
    assert not odd.paths[2].exists()


@pytest.mark.parametrize("counts", ["counts.json", ".counts.json"])
def test_counts_that_cannot_be_read_or_written_hold_no_recording_up(tmp_path, counts):
    (tmp_path / "20260101T000000Z-b0001-00005.mcap").touch()
    (tmp_path / counts).mkdir()
    ring = Ring(tmp_path, RecordingSettings(), Disk(), "boot")
    assert [parse(ring.next_path(0).name) for _ in range(2)] == [(6, False, ""), (7, False, "")]


def test_a_folder_that_may_not_be_read_hides_no_other(tmp_path, monkeypatch):
    for name in ("a", "b", "c"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "20260101T000000Z-b0001-00001.mcap").touch()

    def entries_but_of_b(folder):
        if folder.name == "b":
            raise PermissionError(13, "Permission denied")
        return entries(folder)

    monkeypatch.setattr("wallride.runtime.recording.ring.entries", entries_but_of_b)
    assert [folder.name for folder in folders(tmp_path)] == ["a", "b", "c"]


def test_an_open_file_is_missed_when_it_was_deleted_moved_cut_or_grew(tmp_path):
    disk = Disk()
    for number, harm in enumerate(
        (Path.unlink, lambda path: path.rename(tmp_path / "elsewhere"), lambda path: os.truncate(path, 3),
         lambda path: path.write_bytes(b"12345678 of another"), lambda path: path.parent.rename(tmp_path / "away"))
    ):  # fmt: skip
        path = tmp_path / str(number) / "open.mcap"
        descriptor = disk.create(path)
        disk.write(descriptor, memoryview(b"1234"))
        assert disk.has(descriptor, path, 4)
        harm(path)
        disk.write(descriptor, memoryview(b"5678"))
        assert not disk.has(descriptor, path, 8), number
        disk.close(descriptor)


class NearlyFullDisk(Disk):
    """A disk that misses so much room, until files of 10 MB go. stays: one that cannot be deleted."""

    def __init__(self, missing_mb, stays=None):
        self.free_mb, self.stays = 100 - missing_mb, stays

    def remove(self, path):
        if path == self.stays:
            raise PermissionError(1, "Operation not permitted")
        path.unlink()
        self.free_mb += 10

    def free_bytes(self, _):
        return self.free_mb * MB


@pytest.mark.parametrize(
    ("missing_mb", "odd", "left"),
    [
        (15, "", [False, False, True]),
        (31, "", [True, True, True]),
        (25, "stays", [True, True, True]),
        (25, "is being written", [True, True, True]),
        (15, "stays", [True, False, False]),
        (15, "cannot be opened", [True, False, False]),
    ],
)
def test_recordings_leave_for_the_disk_only_where_that_makes_the_room(tmp_path, missing_mb, odd, left):
    paths = Odd(tmp_path, "refused").paths
    disk = NearlyFullDisk(missing_mb, paths[0] if odd == "stays" else None)
    ring = Ring(tmp_path, RecordingSettings(ring_mb=64, keep_free_mb=100), disk, "boot")
    if odd == "cannot be opened":
        paths[0].unlink()
        paths[0].mkdir()
    with paths[-1 if odd == "cannot be opened" else 0].open("rb") as file:
        if odd == "is being written":
            fcntl.flock(file, fcntl.LOCK_EX)
        assert ring.make_room() is (False in left)
    assert [path.exists() for path in paths] == left
