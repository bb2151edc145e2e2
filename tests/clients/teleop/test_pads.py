"""Both modes of the F710, pads from a file, and the axes that must never steer."""

import math

import pytest

from tests.clients.teleop.recordings import (
    D_DRIVE,
    D_GUID,
    D_REST,
    D_SDL,
    MODE_ON,
    ON_OFF,
    X_DRIVE,
    X_GUID,
    X_REST,
    X_SDL,
)
from wallride.clients.teleop import pad_files
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.pads import (
    F710,
    Axis,
    Button,
    Hat,
    LayoutError,
    PadState,
    choose,
    from_sdl,
    layout,
    parse_binding,
    parse_mapping,
    usb_id,
)
from wallride.clients.teleop.sources import ModeWatch

CONTROLS = (Control.AUTONOMY, Control.ESTOP, Control.RESET, Control.TAKE_OVER)
F710_MODES = {
    "X": (X_GUID, X_SDL, X_REST, X_DRIVE, (5, 1, 7, 3)),
    "D": (D_GUID, D_SDL, D_REST, D_DRIVE, (5, 2, 9, 3)),
}
TEXTS = {
    "speed": "a1~", "steering": "a3~", "manual": "b4", "autonomy": "b5", "estop": "b1", "reset": "b7", "take_over": "b3"
}  # fmt: skip


def pad(rest=X_REST):
    state = PadState()
    for axis, value in enumerate(rest):
        state.rest(axis, value)
    return state


@pytest.mark.parametrize("sdl_knows", [True, False], ids=["SDL's database", "our table"])
@pytest.mark.parametrize(("guid", "line", "rest", "events", "buttons"), F710_MODES.values(), ids=F710_MODES)
def test_f710_forward_and_left_are_positive_and_buttons_are_where_they_belong(
    guid, line, rest, events, buttons, sdl_knows
):
    found = choose(guid, "Logitech", {}, parse_mapping(line) if sdl_knows else None)
    state = pad(rest)
    for event in events:
        state.apply(event, 1.0)
    assert state.read(found.bindings[Control.SPEED]) == 0.5
    assert state.read(found.bindings[Control.STEERING]) == 1.0
    assert state.is_down(found.bindings[Control.MANUAL])
    for index, control in zip(buttons, CONTROLS, strict=True):
        assert not state.is_down(found.bindings[control])
        state.apply(Button(index, pressed=True), 1.0)
        assert state.is_down(found.bindings[control])
    assert found.name in {name for name, _ in F710.values()}


def test_usb_ids_come_from_the_guid_whatever_its_checksum():
    assert usb_id(X_GUID) == "046d:c21f"
    assert usb_id(D_GUID) == "046d:c219"
    assert usb_id("ff00443e6d0400001fc2000000007601") == "046d:c21f"
    assert usb_id("nonsense") == usb_id("00") == ""


def test_a_pad_that_nobody_knows_is_refused_with_the_way_out():
    with pytest.raises(LayoutError, match="--map"):
        choose("03000000341200007856000000000000", "Mystery", {}, None)
    with pytest.raises(LayoutError, match="rightx"):
        from_sdl("Half", {"lefty": "a1"})


def test_ones_own_file_comes_first():
    own = layout("mine", TEXTS | {"speed": "a0"}, "mine.toml")
    assert choose(X_GUID, "Logitech", {X_GUID: own}, parse_mapping(X_SDL)) is own
    assert choose(X_GUID, "Logitech", {"046d:c21f": own}, None) is own


def test_a_trigger_as_steering_never_reads_centred():
    """The classic: the map of one car (steering on axis 2) with a pad in X mode, where axis 2 is a trigger."""
    wrong = layout("F1TENTH map", TEXTS | {"steering": "a2~"}, "test").bindings[Control.STEERING]
    assert pad().read(wrong) == 1.0
    unseen = pad((0.0,) * 6)  # some drivers report 0 until the first touch
    assert unseen.read(wrong) == 0
    unseen.apply(Axis(2, -0.99), 1.0)
    assert math.isnan(unseen.read(wrong))
    unseen.apply(Axis(2, 0.05), 1.0)
    assert unseen.read(wrong) == -0.05


def test_a_repeated_value_is_no_sign_of_life():
    state = pad()
    state.apply(Axis(2, -1.0), 5.0)
    assert (state.events, state.last_event_s) == (0, -math.inf)
    state.apply(Axis(2, -0.9), 6.0)
    assert (state.events, state.last_event_s) == (1, 6.0)


def test_hats_and_half_axes_can_be_buttons():
    state = pad()
    state.apply(Hat(0, -1, 1), 1.0)
    assert [state.is_down(parse_binding(f"h0.{mask}")) for mask in (1, 2, 4, 8)] == [True, False, False, True]
    trigger = parse_binding("+a5")
    assert not state.is_down(trigger)
    state.apply(Axis(5, 0.8), 1.0)
    assert state.is_down(trigger)


@pytest.mark.parametrize("text", ["", "a", "b", "x1", "h0.3", "a1 ", "a1~~", "b-1"])
def test_a_place_that_is_none_is_refused(text):
    with pytest.raises(LayoutError, match="is no control"):
        parse_binding(text)


@pytest.mark.parametrize("text", ["a1", "a12~", "+a2", "-a3", "b10", "h0.8"])
def test_places_are_written_as_they_are_read(text):
    assert str(parse_binding(text)) == text


@pytest.mark.parametrize(
    ("change", "words"),
    [({"speed": "b3"}, "whole axis"), ({"steering": "+a3"}, "whole axis"), ({"manual": "b5"}, "same place"),
     ({"hoot": "b9"}, "is no control"), ({"estop": "?"}, "is no control"), ({"steering": "a1"}, "same place")],
)  # fmt: skip
def test_layouts_that_cannot_drive_are_refused(change, words):
    with pytest.raises(LayoutError, match=words):
        layout("pad", TEXTS | change, "test")
    with pytest.raises(LayoutError, match="reset is missing"):
        layout("pad", {name: at for name, at in TEXTS.items() if name != "reset"}, "test")


def test_mode_button_is_noticed():
    for events, words in ((MODE_ON, "D-pad does nothing"), (ON_OFF, "on/off only")):
        watch = ModeWatch(1)
        assert watch.notice == ""
        for event in events:
            watch.watch(event)
        assert words in watch.notice
        assert "MODE" in watch.notice
        watch.watch(Axis(1, -0.5))
        assert watch.notice == "", "a stick that knows values in between works"


def test_an_ordinary_stick_is_no_mode_button():
    watch = ModeWatch(1)
    for _ in range(10):
        for value in (-0.3, -0.8, -1.0, -0.6, 0.0):
            watch.watch(Axis(1, value))
    assert watch.notice == ""


def test_files_are_read_back_and_broken_ones_are_named(tmp_path):
    bindings = layout("pad", TEXTS, "test").bindings
    path = pad_files.save(tmp_path / "pads", "ABCD", pad_files.to_toml("ABCD", 'My "pad"', bindings))
    (path.parent / "broken.toml").write_text("guid = ")
    (path.parent / "empty.toml").write_text("")
    (path.parent / "wrong.toml").write_text('guid = "1"\n[controls]\nspeed = 3\n')
    layouts, problems = pad_files.read_all(path.parent)
    assert layouts["abcd"].bindings == bindings
    assert [problem.split(":")[0] for problem in problems] == ["broken.toml", "empty.toml", "wrong.toml"]
    assert pad_files.read_all(tmp_path / "nowhere") == ({}, [])
