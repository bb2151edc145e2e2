"""Keys with releases and keys without: when a key counts, and that a doubt is a release."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.key_bytes import KeyBytes
from wallride.clients.teleop.keyboard import (
    CENTRED_START_S,
    REPEAT_GAP_S,
    Act,
    HeldKeys,
    Key,
    KeyEvent,
    Quit,
    RepeatedKeys,
    TerminalAnswer,
    TerminalFocus,
)


def held(*names, keys=None):
    keys = keys or HeldKeys("keys")
    for name in names:
        keys.feed(Key(name), 1.0)
    return keys


def test_shift_is_the_deadman_and_letters_or_arrows_are_the_sticks():
    for names in (("shift", "w", "a"), ("m", "up", "left")):
        inputs = held(*names).inputs(1.0)
        assert (inputs.manual, inputs.speed, inputs.steering) == (True, 1.0, 1.0)
    assert held("w", "s").inputs(1.0).speed == 0
    assert held("w", "up").inputs(1.0).speed == 1
    assert held("space").inputs(1.0).wants_stop
    assert held("p", "r", "t").inputs(1.0).pressed == {Control.AUTONOMY, Control.RESET, Control.TAKE_OVER}


def test_a_release_counts_at_once_and_a_lost_focus_releases_everything():
    keys = held("shift", "w")
    keys.feed(Key("shift", Act.RELEASE), 1.1)
    assert not keys.inputs(1.1).manual
    keys = held("shift", "w")
    keys.feed(TerminalFocus(gained=False), 1.1)
    assert not keys.inputs(1.1).live
    keys.feed(TerminalFocus(gained=True), 1.2)
    assert not keys.inputs(1.3).live, "a key that is held would repeat now"
    assert keys.inputs(1.4).live
    assert keys.inputs(1.4).released


def test_a_key_that_is_held_from_before_counts_after_its_release():
    keys = held("p")
    for gained in (False, True):
        keys.feed(TerminalFocus(gained=gained), 1.1)
    keys.feed(Key("p", Act.REPEAT), 1.15)
    assert (keys.inputs(1.5).live, keys.inputs(1.5).pressed) == (False, frozenset())
    keys.feed(Key("p", Act.RELEASE), 1.6)
    assert keys.inputs(1.6).live
    assert held("p", keys=keys).inputs(1.7).autonomy


def test_what_was_typed_is_not_held_but_a_space_stops():
    keys = HeldKeys("keys")
    for name in ("p", "shift", "w", "space"):
        keys.feed(Key(name, Act.TYPED), 1.0)
    assert keys.inputs(1.1).pressed == {Control.ESTOP}
    assert keys.inputs(1.1).speed == 0
    assert keys.inputs(1.2).released


def test_a_terminal_that_does_not_answer_is_not_believed():
    keys = HeldKeys("keys", answers=True)
    assert not keys.inputs(1.0).live
    keys.feed(TerminalAnswer(11), 1.0)
    held("shift", keys=keys)
    assert keys.inputs(1.5).manual
    assert not keys.inputs(1.7).live
    keys.feed(TerminalAnswer(11), 2.0)
    assert keys.inputs(2.0).manual, "it was not seen to go up"


def typed(name, start_s, until_s, delay_s=0.5, period_s=0.04):
    """The times at which a terminal sends a key that is held."""
    times = [start_s]
    at_s = start_s + delay_s
    while at_s < until_s:
        times.append(at_s)
        at_s += period_s
    return [(at_s, name) for at_s in times]


def play(events, until_s):
    """Return (time, inputs) every 0.01 s."""
    keys, out, events = RepeatedKeys("keys"), [], list(events)
    for tick in range(round(until_s / 0.01)):
        now_s = round(tick * 0.01, 2)
        while events and events[0][0] <= now_s + 1e-9:
            keys.feed(Key(events.pop(0)[1]), now_s)
        out.append((now_s, keys.inputs(now_s)))
    return out


@pytest.mark.parametrize(("delay_s", "period_s"), [(0.25, 0.033), (0.5, 0.04), (0.66, 0.092)])
def test_a_held_key_counts_once_it_repeats_and_ends_soon_after_the_last(delay_s, period_s):
    driving = [(t, i) for t, i in play(typed("w", 0.1, 2.0, delay_s, period_s), 3.0) if i.manual]
    first_s, last_s = driving[0][0], driving[-1][0]
    assert 0.1 + delay_s <= first_s <= 0.1 + delay_s + 2 * period_s + 0.02
    assert last_s <= 2.0 + REPEAT_GAP_S + 0.01
    assert driving[0][1].centred, "first the deadman alone"
    assert driving[-1][1].speed == 1
    assert {i.speed for t, i in driving if t < first_s + CENTRED_START_S - 0.011} == {0.0}


@given(st.lists(st.floats(0.16, 3.0), max_size=10), st.sampled_from("wasdqezcprt"))
def test_taps_never_move_anything(gaps, name):
    at_s, events = 0.0, []
    for gap in gaps:
        at_s += gap
        events.append((at_s, name))
    assert all(inputs.released for _, inputs in play(events, at_s + 1))


def test_another_key_ends_the_first_one_at_once():
    events = [*typed("w", 0.0, 1.0), *typed("e", 1.0, 2.0)]
    at = dict(play(events, 2.0))
    assert at[0.95].speed == 1
    assert not any(inputs.manual for now_s, inputs in at.items() if 1.0 <= now_s < 1.5)
    assert (at[1.9].speed, at[1.9].steering) == (1, -1)


def test_the_space_bar_stops_at_the_first_stroke_and_permit_needs_repeats():
    at = dict(play([(0.1, "space")], 0.5))
    assert at[0.1].wants_stop
    assert not at[0.4].wants_stop
    assert any(inputs.autonomy for _, inputs in play(typed("p", 0.0, 1.0), 1.0))


BYTES: dict[bytes, list[KeyEvent]] = {
    b"w": [Key("w", Act.TYPED)],
    b"W": [Key("w", Act.TYPED)],
    b" ": [Key("space", Act.TYPED)],
    b"\x1b[A": [Key("up")],
    b"\x1bOD": [Key("left", Act.TYPED)],
    b"\x1b[1;2C": [Key("right")],
    b"\x1b[1;1:3B": [Key("down", Act.RELEASE)],
    b"\x1b[119u": [Key("w")],
    b"\x1b[119;1:2u": [Key("w", Act.REPEAT)],
    b"\x1b[119;2:3u": [Key("w", Act.RELEASE)],
    b"\x1b[119:87;2:1u": [Key("w")],
    b"\x1b[57441;2u": [Key("shift")],
    b"\x1b[57447;2:3u": [Key("shift", Act.RELEASE)],
    b"\x1b[32u": [Key("space")],
    b"\x1b[27u": [Key("escape")],
    b"\x1bs": [Key("escape", Act.TYPED), Key("s", Act.TYPED)],
    b"\x1b\x1b[A": [Key("escape", Act.TYPED), Key("up")],
    b"\x1bOP": [],
    b"\x1bO2P": [],
    b"\x1bOa": [],
    b"\x1b[7$": [],
    b"\x1b[[A": [],
    b"\x1b[99;5u": [Quit()],
    b"\x1b[99u": [Key("c")],
    b"\x03": [Quit()],
    b"\x1b[?11u": [TerminalAnswer(11)],
    b"\x1b[?62;22c": [],
    b"\x1b[I": [TerminalFocus(gained=True)],
    b"\x1b[O": [TerminalFocus(gained=False)],
    b"\x1b[57358u": [],
    b"\xc3\xa9": [],
    b"7": [],
}


@pytest.mark.parametrize(("raw", "events"), BYTES.items(), ids=[repr(raw) for raw in BYTES])
def test_bytes_of_terminals(raw, events):
    assert KeyBytes().feed(raw, 1.0) == events


@given(st.lists(st.sampled_from(list(BYTES)), max_size=8), st.lists(st.integers(1, 5), min_size=60, max_size=60))
def test_any_chunking_gives_the_same_keys(parts, sizes):
    stream, reader, events = b"".join(parts), KeyBytes(), []
    for size in sizes:
        chunk, stream = stream[:size], stream[size:]
        events += reader.feed(chunk, 1.0)
    events += reader.feed(stream, 1.0)
    assert events == [event for part in parts for event in BYTES[part]]


@given(st.binary(max_size=40))
def test_noise_is_never_an_error(noise):
    KeyBytes().feed(noise, 1.0)


def test_a_lone_escape_is_the_key_after_a_moment():
    reader = KeyBytes()
    assert reader.feed(b"\x1b", 1.0) == []
    assert reader.feed(b"", 1.05) == []
    assert reader.feed(b"", 1.11) == [Key("escape", Act.TYPED)]


@pytest.mark.parametrize("more", [b"[", b"O", b"O1"])
def test_an_escape_with_a_key_that_begins_a_sequence_is_the_key_after_a_moment(more):
    reader = KeyBytes()
    assert reader.feed(b"\x1b", 1.0) == []
    assert reader.feed(more, 1.05) == []
    assert reader.feed(b"", 1.16) == [Key("escape", Act.TYPED)]
    assert reader.feed(b"w", 1.2) == [Key("w", Act.TYPED)]


def test_an_escape_that_is_held_is_the_key_from_its_second_byte_on():
    reader = KeyBytes()
    assert reader.feed(b"\x1b", 1.0) == []
    assert reader.feed(b"\x1b", 1.03) == [Key("escape", Act.TYPED)]
