"""Files are written whole or not at all: what a full disk, Ctrl-C and odd places leave behind."""

import errno
import os
import stat
from pathlib import Path

import pytest

from tests.full_disk import full_disk
from wallride.runtime.host.output_files import write_answer, write_file, write_files

SMALL_B, LARGE = 100, b"x" * 1000


def test_a_full_disk_leaves_none_of_several_files_and_names_the_one(tmp_path):
    first, second = tmp_path / "lab.yaml", tmp_path / "lab.pgm"
    with full_disk(SMALL_B), pytest.raises(OSError, match=r"lab\.pgm") as told:
        write_files({first: "image: lab.pgm\n", second: LARGE})
    assert told.value.filename == str(second)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_was_there_stays_as_it_was(tmp_path):
    file = tmp_path / "run.html"
    file.write_text("the page before")
    with full_disk(SMALL_B), pytest.raises(OSError, match=r"run\.html"):
        write_file(file, LARGE)
    assert [one.read_text() for one in tmp_path.iterdir()] == ["the page before"]


def test_an_interrupted_writer_leaves_nothing(tmp_path):
    def interrupted(file):
        file.write(b"half of a pict")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_file(tmp_path / "lab.png", interrupted)
    assert list(tmp_path.iterdir()) == []


def test_rights_and_links_stay(tmp_path):
    file, link = tmp_path / "figures.json", tmp_path / "newest.json"
    file.write_text("{}")
    file.chmod(0o640)
    link.symlink_to(file)
    write_answer("[1]\n", str(link))
    assert (link.is_symlink(), file.read_text()) == (True, "[1]\n")
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    fresh = tmp_path / "fresh"
    write_file(fresh, "x")
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE(fresh.stat().st_mode) == 0o666 & ~mask


def test_a_device_is_written_to_and_not_replaced():
    with pytest.raises(OSError, match="/dev/full") as told:
        write_file(Path("/dev/full"), LARGE)
    assert told.value.errno == errno.ENOSPC
    assert stat.S_ISCHR(Path("/dev/full").stat().st_mode)


def test_a_name_that_is_no_text_can_be_written_about(tmp_path):
    write_file(tmp_path / "page", "recording \udcff")
    assert (tmp_path / "page").read_text() == r"recording \udcff"
