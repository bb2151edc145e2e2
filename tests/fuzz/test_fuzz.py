"""A short run of the fuzzer on every target, and what it once found, or was found by hand."""

import contextlib
import io
import math
import zipfile

import numpy as np
import pytest

from tests.fuzz.__main__ import fuzz
from tests.fuzz.file_targets import Files, _archive
from tests.fuzz.wire_targets import seeds_of_wires
from wallride.drivers.api import printable
from wallride.drivers.hokuyo.codec import ReplyBlock
from wallride.drivers.hokuyo.replies import fields
from wallride.drivers.vesc import replies
from wallride.runtime.security.access_list import KeysError, read_people
from wallride.runtime.settings.tree import SettingsError, load_settings
from wallride.sim.recordings.loading import load_recording
from wallride.sim.recordings.recording import RecordingError

COUNTS = {"scip": 1000, "vesc": 1000, "teleop": 1000, "parameters": 500, "page": 1000, "settings": 100, "people": 200,
          "mcap": 8, "bag": 8, "npz": 100}  # fmt: skip


@pytest.fixture(scope="module")
def targets():
    with contextlib.closing(Files()) as files:
        yield {**seeds_of_wires(), **files.seeds()}


@pytest.mark.parametrize("name", COUNTS)
def test_damaged_inputs_raise_nothing(targets, name, tmp_path, monkeypatch):
    monkeypatch.setattr("tests.fuzz.__main__.SLOW_S", math.inf)  # how long one takes is the machine's load as well
    target, good, most = targets[name]
    assert fuzz(name, target, good, most, seed=1, count=COUNTS[name], seconds=1e9, findings=tmp_path)[1] == 0


def test_the_fuzzer_finds_what_raises(tmp_path, capsys):
    def target(_dice, data):
        assert b"\xff" not in data

    assert fuzz("x", target, [b"abc"], 100, seed=1, count=200, seconds=1e9, findings=tmp_path)[1] == 10
    assert "AssertionError" in capsys.readouterr().out
    assert len(list(tmp_path.iterdir())) == 10


@pytest.mark.parametrize("text", ["a = " + "[" * 5000, "a = " + "9" * 5000, "[" * 5000, "a." * 3000 + "b = 1"])
def test_settings_of_brackets_or_digits_are_refused_in_a_sentence(tmp_path, text):
    file = tmp_path / "car.toml"
    file.write_text(text)
    with pytest.raises(SettingsError, match=r"car\.toml"):
        load_settings(file)
    with pytest.raises(KeysError, match=r"car\.toml"):
        read_people(file)
    with pytest.raises(SettingsError):
        load_settings(None, [f"car.name={text[4:]}"])


def rewritten(name, content):
    """Return an archive in which one array's file has another content."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(_archive(np.savez))) as good, zipfile.ZipFile(out, "w") as bad:
        for member in good.namelist():
            bad.writestr(member, content if member == f"{name}.npy" else good.read(member))
    return out.getvalue()


def header(text):
    text = text.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("ranges", header("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000)}"), "claims"),
        ("ranges", header("{'descr': '<f8', 'fortran_order': False, 'shape': (3, "), "no readable archive"),
        ("ranges", header("[" * 110), "no readable archive"),
        ("ranges", b"\x93NUMPY\x09\x00", "no readable archive"),
        ("ranges", b"", "no readable archive"),
        ("angle_increment", _archive(np.savez)[:0] + header("{'descr': '<f8', 'fortran_order': False, 'shape': ()}")
         + bytes(8), r"steps of 0\.0 rad"),
        ("angle_min", header("{'descr': '<f8', 'fortran_order': False, 'shape': ()}") + np.array(np.nan).tobytes(),
         "begin at nan rad"),
    ],
)  # fmt: skip
def test_an_archive_that_lies_is_refused_in_a_sentence(tmp_path, name, content, words):
    file = tmp_path / "one.npz"
    file.write_bytes(rewritten(name, content))
    with pytest.raises(RecordingError, match=words) as caught:
        load_recording(file)
    assert len(str(caught.value)) < 1000


def test_what_a_device_says_of_itself_is_printable():
    evil = b"UST\x1b[2J\x07\n\x9b31mX"
    assert printable(evil) == "UST?[2J????31mX".replace("????", "??\ufffd")
    assert fields(ReplyBlock(b"PP", "00", (b"MODL:" + evil,)))["MODL"].isprintable()
    firmware = replies.decode_firmware(bytes([0, 6, 5]) + evil + b"\0")
    assert firmware is not None
    assert firmware.hardware.isprintable()
