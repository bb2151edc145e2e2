"""A real disk that is too small, and one that may only be read. Needs root: it mounts a file system in memory."""

import os
import shutil
import subprocess
from contextlib import contextmanager

import pytest

from tests.runtime.recording.drives import driven
from tests.runtime.recording.reading import scans_in
from tests.runtime.recording.recorded import files
from wallride.runtime.recording.recover import is_whole

SIZE_MB = 6


@contextmanager
def mounted(path):
    if os.geteuid() != 0 or shutil.which("mount") is None:
        pytest.skip("only root can mount a file system")
    path.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={SIZE_MB}m", "tmpfs", str(path)]
    if subprocess.run(command, check=False, capture_output=True).returncode != 0:
        pytest.skip("this machine lets nobody mount a file system")
    try:
        yield path
    finally:
        subprocess.run(["umount", str(path)], check=True)


async def test_a_disk_that_others_fill_is_said_and_recording_goes_on_when_they_clear_it(tmp_path):
    with mounted(tmp_path / "disk") as disk:
        drive = await driven(disk / "recordings", 3, start="always", black_box_s=20)
        others = disk / "photos"
        with pytest.raises(OSError, match="No space left"):
            others.write_bytes(bytes(SIZE_MB << 20))
        sent = len(drive.motor.wire)
        await drive.go(7)
        assert len(drive.motor.wire) - sent == pytest.approx(7 * 40, abs=2)
        assert "the disk is full" in drive.recorder.status()["words"]
        others.unlink()
        await drive.go(6)
        assert drive.recorder.status()["words"] == "recording: always"
        drive.recorder.finish()
        recorded = {number for path in files(disk / "recordings") for number in scans_in(path.read_bytes())}
        assert recorded == set(range(len(drive.scans)))


async def test_on_a_small_disk_the_oldest_makes_room(tmp_path, monkeypatch):
    monkeypatch.setattr("wallride.runtime.recording.writer.MB", 100_000)
    with mounted(tmp_path / "disk") as disk:
        drive = await driven(disk, 25, start="always", file_mb=8, keep_free_mb=2, black_box_s=2)
        assert drive.recorder.status()["on"] is True
        drive.recorder.finish()
        kept = files(disk)
        assert "-00001." not in kept[0].name
        assert all(map(is_whole, kept))
        assert scans_in(kept[-1].read_bytes())[-1] == len(drive.scans) - 1


async def test_a_read_only_disk_is_said(tmp_path):
    with mounted(tmp_path / "disk") as disk:
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        drive = await driven(disk / "recordings", 2, start="always")
        assert "read-only" in drive.recorder.status()["words"]
        subprocess.run(["mount", "-o", "remount,rw", str(disk)], check=True)
        await drive.go(6)
        assert drive.recorder.status()["words"] == "recording: always"
        drive.recorder.finish()
