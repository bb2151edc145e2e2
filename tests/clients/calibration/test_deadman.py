"""The key of a calibration: held is driving, anything else is not."""

import pytest

from wallride.clients.calibration import deadman as deadmen
from wallride.clients.calibration.deadman import TerminalDeadman
from wallride.clients.calibration.link import LetGoError
from wallride.clients.teleop.keyboard import Act, Key, Quit, TerminalAnswer, TerminalFocus


class Terminal:
    """Key events of a story."""

    def __init__(self, *, releases):
        self.releases = releases
        self.events = []

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        pass

    def poll(self):
        found, self.events = self.events, []
        return found


class Clock:
    now_s = 0.0

    def monotonic(self):
        return self.now_s

    def sleep(self, time_s):
        self.now_s += time_s


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(deadmen, "time", clock)
    return clock


def begun(monkeypatch, *, releases):
    terminal = Terminal(releases=releases)
    monkeypatch.setattr(deadmen, "Terminal", lambda *_args, **_options: terminal)
    return TerminalDeadman(), terminal


def test_a_key_with_releases_is_held_from_press_to_release(monkeypatch, clock):
    deadman, terminal = begun(monkeypatch, releases=True)
    with deadman:
        assert (deadman.key, deadman.is_held()) == ("M", False)
        terminal.events = [TerminalAnswer(11), Key("m")]
        assert deadman.is_held()
        clock.sleep(0.1)
        assert deadman.is_held()
        terminal.events = [Key("m", Act.RELEASE)]
        assert not deadman.is_held()
        terminal.events = [Key("m"), TerminalFocus(gained=False)]
        assert not deadman.is_held()


def test_a_key_that_only_repeats_is_held_while_it_does(monkeypatch, clock):
    deadman, terminal = begun(monkeypatch, releases=False)
    with deadman:
        held = []
        for _ in range(6):
            terminal.events = [Key("w")]
            held.append(deadman.is_held())
            clock.sleep(0.04)
        assert (deadman.key, held[0], held[-1]) == ("W", False, True)
        clock.sleep(0.2)
        assert not deadman.is_held()


@pytest.mark.parametrize("event", [Key("space"), Key("escape"), Quit()])
def test_space_and_ctrl_c_end_it(monkeypatch, clock, event):
    deadman, terminal = begun(monkeypatch, releases=True)
    with deadman:
        terminal.events = [TerminalAnswer(11), event]
        with pytest.raises(LetGoError):
            deadman.is_held()


def test_a_stall_needs_a_new_press(monkeypatch, clock):
    deadman, terminal = begun(monkeypatch, releases=True)
    story = {0.0: Key("m"), 0.1: Key("m", Act.RELEASE), 0.2: Key("m")}

    def told():
        return [TerminalAnswer(11), *(story.pop(at_s) for at_s in list(story) if at_s <= clock.now_s)]

    monkeypatch.setattr(terminal, "poll", told)
    with deadman:
        deadman.renew()
    assert clock.now_s >= 0.2
