"""What Linux's records mean, for the pads that people have."""

import pytest

from tests.clients.joystick import fake_pads as pads
from wallride.clients.joystick.evdev import EV_ABS, EV_KEY, EventReader
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.pads import Axis, Button, Hat, LayoutError, choose


def layout(description):
    return choose(description.guid, description.name, {}, description.mapping())


@pytest.mark.parametrize(
    ("description", "places"),
    [
        # As SDL's database has them for these GUIDs.
        (pads.F710_X, "a1~ a3~ b4 b5 b1 b7 b3"),
        (pads.F710_D, "a1~ a2~ b4 b5 b2 b9 b3"),
        (pads.XBOX_360, "a1~ a3~ b4 b5 b1 b7 b3"),
        (pads.XBOX_BLUETOOTH, "a1~ a2~ b6 b7 b1 b11 b4"),
        (pads.PS4, "a1~ a3~ b4 b5 b1 b9 b2"),
        (pads.PS5, "a1~ a3~ b4 b5 b1 b9 b2"),
    ],
)
def test_known_pads_have_their_controls_where_sdl_has_them(description, places):
    assert description.is_pad
    found = layout(description).bindings
    order = ("speed", "steering", "manual", "autonomy", "estop", "reset", "take_over")
    assert " ".join(str(found[Control(name)]) for name in order) == places


def test_a_pad_whose_axes_are_in_another_order_is_not_guessed():
    assert pads.PS4_WITHOUT_DRIVER.is_pad
    with pytest.raises(LayoutError, match="--map"):
        layout(pads.PS4_WITHOUT_DRIVER)


@pytest.mark.parametrize("description", [pads.PS4_GYRO, pads.KEYBOARD])
def test_other_devices_are_no_pads(description):
    assert not description.is_pad


def test_the_guid_is_that_of_sdl():
    assert pads.F710_X.guid == "030000006d0400001fc2000005030000"
    assert pads.F710_D.guid == "030000006d04000019c2000011010000"


@pytest.mark.parametrize(
    ("record", "event"),
    [
        ((EV_ABS, 1, -32768), Axis(1, -1.0)),
        ((EV_ABS, 1, 32767), Axis(1, 1.0)),
        ((EV_ABS, 2, 0), Axis(2, -1.0)),
        ((EV_ABS, 3, 70000), Axis(3, 1.0)),
        ((EV_KEY, 310, 1), Button(4, pressed=True)),
        ((EV_KEY, 310, 0), Button(4, pressed=False)),
        ((EV_KEY, 310, 2), None),
        ((EV_KEY, 30, 1), None),
        ((EV_ABS, 17, -1), Hat(0, 0, 1)),
        ((EV_ABS, 40, 7), None),
        ((4, 4, 7), None),
    ],
)
def test_one_record(record, event):
    assert EventReader(pads.F710_X).event(*record) == event


def test_a_record_that_is_cut_off_is_left_out():
    pad, reader = pads.FakePad(), EventReader(pads.F710_X)
    pad.hold(pads.LB)
    assert list(reader.feed(pad.read()[:-5])) == [Button(4, pressed=True)]


def test_after_records_were_dropped_the_state_is_asked_for():
    pad, reader = pads.FakePad(), EventReader(pads.F710_X)
    pad.overflow()
    pad.hold(pads.RB)
    assert list(reader.feed(pad.read())) == [None, Button(5, pressed=True)]
