"""Pads that come and go, in the words of SDL; the terminal's space bar; scripts that wait for the car."""

import math

import pytest

from tests.clients.teleop.recordings import D_DRIVE, D_GUID, D_REST, MODE_ON, X_DRIVE, X_GUID, X_REST, X_SDL
from wallride.clients.teleop import sources
from wallride.clients.teleop.gamepad import Gone, KeyTyped, PadConnected, PadMoved
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.keyboard import Act, Key, Quit, TerminalFocus
from wallride.clients.teleop.pads import Axis, Button, parse_mapping
from wallride.clients.teleop.script import Script, Step
from wallride.runtime.wire.teleop import Input


class Queue:
    """SDL or a terminal, from a list."""

    def __init__(self):
        self.waiting = []
        self.shown = []

    def poll(self):
        now, self.waiting = self.waiting, []
        return now

    def show(self, lines, mood):
        self.shown.append((lines, mood))


X_PAD = PadConnected(0, X_GUID, "Logitech Gamepad F710", X_REST, parse_mapping(X_SDL))
D_PAD = PadConnected(1, D_GUID, "Logitech Cordless RumblePad 2", D_REST, None)
UNKNOWN = PadConnected(2, "03000000341200007856000000000000", "Mystery", (0.0,), None)


def feed(source, queue, *happenings, now_s=1.0):
    queue.waiting += happenings
    return source.poll(now_s, ready=True)


def test_a_pad_is_adopted_drives_and_is_unplugged():
    sdl = Queue()
    source = sources.PadSource(sdl, {})
    assert feed(source, sdl).trouble == sources.PLUG_IN
    assert not feed(source, sdl, X_PAD).live
    idle = feed(source, sdl)
    assert (idle.live, idle.event_s, idle.device) == (True, -math.inf, "Logitech F710 (X)")
    assert "no event since" in idle.trouble
    driving = feed(source, sdl, *(PadMoved(0, event) for event in X_DRIVE), now_s=2.0)
    assert (driving.manual, driving.speed, driving.steering, driving.event_s) == (True, 0.5, 1.0, 2.0)
    assert driving.trouble == ""
    assert not feed(source, sdl, Gone(0)).live


def test_unplugged_and_back_within_one_poll_is_noticed_and_starts_from_nothing():
    sdl = Queue()
    source = sources.PadSource(sdl, {})
    feed(source, sdl, X_PAD)
    feed(source, sdl, *(PadMoved(0, event) for event in X_DRIVE))
    assert not feed(source, sdl, Gone(0), X_PAD).live
    assert feed(source, sdl).released


def test_the_other_pad_takes_its_turn_only_after_a_moment_without_any():
    sdl = Queue()
    source = sources.PadSource(sdl, {})
    feed(source, sdl, X_PAD, D_PAD)
    assert feed(source, sdl, PadMoved(1, Button(4, pressed=True))).released, "only one pad counts"
    assert not feed(source, sdl, Gone(0)).live
    assert feed(source, sdl, *(PadMoved(1, event) for event in D_DRIVE)).device == "Logitech F710 (D)"


def test_what_is_held_when_a_pad_is_plugged_in_is_held():
    sdl = Queue()
    source = sources.PadSource(sdl, {})
    held = [PadMoved(0, Button(index, pressed=True)) for index in (1, 4)]
    feed(source, sdl, X_PAD, *held)
    assert feed(source, sdl).pressed == {Control.ESTOP, Control.MANUAL}


def test_an_unknown_pad_is_named_with_the_way_out_and_a_wanted_one_is_waited_for():
    sdl = Queue()
    assert "--map" in feed(sources.PadSource(sdl, {}), sdl, UNKNOWN).trouble
    source = sources.PadSource(sdl, {}, wanted="c219")
    assert "not the --pad" in feed(source, sdl, X_PAD).trouble
    feed(source, sdl, D_PAD)
    assert feed(source, sdl).device == "Logitech F710 (D)"


def test_mode_is_said():
    sdl = Queue()
    source = sources.PadSource(sdl, {})
    feed(source, sdl, X_PAD)
    assert "press MODE" in feed(source, sdl, *(PadMoved(0, event) for event in MODE_ON)).trouble


def pad_or_keys(*, releases=False):
    sdl, keys = Queue(), Queue()
    pads = sources.PadSource(sdl, {})
    return sources.PadOrKeySource(pads, sources.KeySource(keys, releases=releases), 4.0), sdl, keys


@pytest.mark.parametrize("name", ["space", "escape"])
@pytest.mark.parametrize("releases", [False, True])
def test_space_and_escape_stop_with_a_pad_in_hand_and_without_one(name, releases):
    source, sdl, keys = pad_or_keys(releases=releases)
    keys.waiting = [Key(name)]
    assert feed(source, sdl).wants_stop, "also before the terminal has answered"
    keys.waiting = [Key(name, Act.RELEASE)] if releases else []
    feed(source, sdl, X_PAD, now_s=2.0)
    assert not feed(source, sdl, now_s=2.1).wants_stop
    keys.waiting = [Key(name)]
    assert feed(source, sdl, now_s=3.0).wants_stop
    keys.waiting = [Key(name, Act.RELEASE)] if releases else []
    feed(source, sdl, Gone(0), now_s=4.0)
    keys.waiting = [Key(name)]
    assert feed(source, sdl, now_s=5.0).wants_stop, "and when the pad is gone"
    keys.waiting = [Quit()]
    feed(source, sdl)
    assert source.leaving


@pytest.mark.parametrize("name", ["space", "escape"])
def test_space_and_escape_stop_beside_a_script_and_a_window(name):
    others = (
        sources.ScriptSource(Script([Step(0.0, frozenset({Control.MANUAL})), Step(9.0, frozenset())])),
        sources.WindowSource(Queue()),
    )
    for other in others:
        keys = Queue()
        source = sources.StopKeySource(other, keys)
        assert not source.poll(1.0, ready=True).wants_stop
        keys.waiting = [Key(name)]
        assert source.poll(1.1, ready=True).wants_stop
        assert source.poll(1.2, ready=True).wants_stop
        assert not source.poll(1.5, ready=True).wants_stop
        assert source.names == other.names
        keys.waiting = [Quit()]
        source.poll(1.6, ready=True)
        assert source.leaving


def held(keys, name, source, sdl, until_s, since_s):
    """Hold a key of a terminal that only repeats; return the last inputs."""
    inputs, now_s = None, since_s
    while now_s < until_s:
        keys.waiting = [Key(name)]
        inputs = feed(source, sdl, now_s=now_s)
        now_s += 0.04
    return inputs


def test_without_a_pad_the_keyboard_drives_until_one_is_plugged_in():
    source, sdl, keys = pad_or_keys()
    idle = feed(source, sdl)
    assert (idle.kind, idle.live, idle.released, idle.trouble) == (Input.KEYBOARD, True, True, sources.NO_PAD)
    assert "W A S D" in source.names[Control.MANUAL]
    driving = held(keys, "w", source, sdl, 2.0, 1.0)
    assert (driving.manual, driving.speed) == (True, 1.0)
    feed(source, sdl, X_PAD, now_s=2.1)
    idle = feed(source, sdl, now_s=2.2)
    assert (idle.kind, idle.released) == (Input.PAD, True)
    assert source.names[Control.MANUAL] == "LB"


def test_a_key_steers_gradually_and_centres_at_once():
    source, sdl, keys = pad_or_keys()
    feed(source, sdl, now_s=1.0)
    first = held(keys, "q", source, sdl, 1.3, 1.04)
    assert 0 < first.steering < 1
    assert held(keys, "q", source, sdl, 2.0, 1.3).steering == 1.0
    assert feed(source, sdl, now_s=2.5).steering == 0.0


def test_a_pad_that_is_lost_is_no_release_until_a_key_is_pressed():
    source, sdl, keys = pad_or_keys()
    feed(source, sdl, X_PAD)
    feed(source, sdl)
    assert feed(source, sdl, *(PadMoved(0, event) for event in X_DRIVE), now_s=2.0).manual
    lost = feed(source, sdl, Gone(0), now_s=2.1)
    assert (lost.live, lost.trouble) == (False, sources.LOST_PAD)
    assert not feed(source, sdl, now_s=60.0).live, "however long that takes"
    keys.waiting = [Key("w")]
    assert not feed(source, sdl, now_s=61.0).manual, "a tap is no drive"
    assert held(keys, "w", source, sdl, 63.0, 62.0).manual


def test_a_window_sees_releases_and_shows_the_screen():
    sdl = Queue()
    source = sources.WindowSource(sdl)
    assert feed(source, sdl, KeyTyped(Key("shift")), KeyTyped(Key("w")), PadMoved(0, Axis(0, 1.0))).manual
    assert not feed(source, sdl, KeyTyped(Key("shift", Act.RELEASE))).manual
    assert not feed(source, sdl, KeyTyped(TerminalFocus(gained=False))).live
    assert source.window is not None
    source.window.show(["ready"], "green")
    assert sdl.shown == [(["ready"], "green")]
    feed(source, sdl, KeyTyped(Quit()))
    assert source.leaving


def test_a_terminal_with_and_without_releases():
    keys = Queue()
    plain = sources.KeySource(keys, releases=False)
    assert not feed(plain, keys, Key("w")).manual
    releases = sources.KeySource(keys, releases=True)
    assert not feed(releases, keys, Key("shift")).live, "not before the terminal answered"
    feed(releases, keys, Quit())
    assert releases.leaving


def test_a_script_waits_until_the_car_is_ready():
    source = sources.ScriptSource(Script([Step(0.0, frozenset({Control.MANUAL})), Step(1.0, frozenset())]))
    assert source.poll(5.0, ready=False).released
    assert source.poll(6.0, ready=True).manual
    assert source.poll(6.5, ready=False).manual
    assert not source.leaving
    assert source.poll(7.0, ready=True).released
    assert source.leaving
