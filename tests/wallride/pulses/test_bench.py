"""Devices are closed, and the last word is neutral, when the process is told to end, too."""

import os
import signal

import pytest

from wallride.clients.calibration.ways import CalibrationError
from wallride.pulses import command
from wallride.runtime.settings.tree import load_settings


class FakeDevices:
    """Devices that note what is asked of them. instead: done when a scan is asked for."""

    words: list[str] = []  # noqa: RUF012 - one for each test, set by its fixture
    instead = staticmethod(lambda: None)

    def __init__(self, _settings, steering_us, neutral_us):
        self.words.append(f"made {steering_us:g} {neutral_us:g}")

    async def open(self):
        self.words.append("open")

    async def order(self, steering_us, throttle_us, neutral_us):
        self.words.append(f"order {throttle_us:g}, then {neutral_us:g}")
        return steering_us, throttle_us

    async def next_scan(self):
        self.instead()

    async def close(self, stop_us, neutral_us):
        self.words.append(f"stop {stop_us:g}, then {neutral_us:g}")


@pytest.fixture
def words(monkeypatch):
    monkeypatch.setattr(FakeDevices, "words", [])
    monkeypatch.setattr(command, "PulseDevices", FakeDevices)
    return FakeDevices.words


def opened():
    one = command.PulseBench(load_settings(None, ["motor.driver=maestro"]))
    one.open(1500.0, 1510.0)
    return one


def test_orders_go_through_and_the_end_is_a_stop_and_neutral(words):
    one = opened()
    assert one.write(1490.0, 1600.0, 1510.0) == (1490.0, 1600.0)
    one.close(1400.0, 1510.0)
    assert words == ["made 1500 1510", "open", "order 1600, then 1510", "stop 1400, then 1510"]
    one.close(1400.0, 1510.0)
    assert len(words) == 4
    with pytest.raises(CalibrationError, match="not open"):
        one.next_scan()


@pytest.mark.parametrize("number", command.ENDING)
def test_a_terminal_that_goes_away_ends_in_neutral(words, number):
    before = signal.getsignal(number)
    one = opened()
    with pytest.raises(SystemExit):
        os.kill(os.getpid(), number)
    one.close(1400.0, 1510.0)
    assert words[-1] == "stop 1400, then 1510"
    assert signal.getsignal(number) is before


def test_an_error_of_the_devices_reaches_the_step(words, monkeypatch):
    def lost():
        raise CalibrationError("no scan")

    monkeypatch.setattr(FakeDevices, "instead", staticmethod(lost))
    one = opened()
    with pytest.raises(CalibrationError, match="no scan"):
        one.next_scan()
    one.close(1400.0, 1510.0)
    assert words[-1] == "stop 1400, then 1510"
