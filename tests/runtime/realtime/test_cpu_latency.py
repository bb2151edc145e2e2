"""While the car drives, the processor's cores do not sleep; where that is impossible, it is said and no more."""

import struct

from wallride.runtime.realtime.cpu_latency import awake


def test_the_file_is_held_open_with_no_latency_in_it(tmp_path):
    device = tmp_path / "cpu_dma_latency"
    device.touch()
    with awake(wanted=True, device=device) as words:
        assert words == "the processor is kept awake between two scans"
        assert device.read_bytes() == struct.pack("=i", 0)


def test_who_does_not_want_it_does_not_get_it(tmp_path):
    device = tmp_path / "cpu_dma_latency"
    device.touch()
    with awake(wanted=False, device=device) as words:
        assert "may doze" in words
    assert device.read_bytes() == b""


def test_a_missing_or_refused_file_is_said_and_stops_nothing(tmp_path):
    with awake(wanted=True, device=tmp_path / "none") as words:
        assert "is not there" in words
    with awake(wanted=True, device=tmp_path) as words:  # a folder cannot be written to
        assert "stay_awake = false" in words
