"""Our reader of SDL against SDL itself: a virtual F710 is plugged in, driven and unplugged, without a display."""

import ctypes
import os
import re
from pathlib import Path

import pytest

pytest.importorskip("pygame")

from wallride.clients.teleop.gamepad import Gone, KeyTyped, PadConnected, PadMoved, Sdl
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.keyboard import Act, Key, Quit, TerminalFocus
from wallride.clients.teleop.pads import Axis, Button, usb_id
from wallride.clients.teleop.sources import PadSource

MAPS = Path("/proc/self/maps")


class Description(ctypes.Structure):
    """SDL_VirtualJoystickDesc of SDL 2.24 and later."""

    _fields_ = (
        ("version", ctypes.c_uint16), ("type", ctypes.c_uint16), ("axes", ctypes.c_uint16),
        ("buttons", ctypes.c_uint16), ("hats", ctypes.c_uint16), ("vendor", ctypes.c_uint16),
        ("product", ctypes.c_uint16), ("padding", ctypes.c_uint16), ("button_mask", ctypes.c_uint32),
        ("axis_mask", ctypes.c_uint32), ("name", ctypes.c_char_p), ("more", ctypes.c_void_p * 8),
    )  # fmt: skip


class VirtualPad:
    """A pad that SDL makes up; its axes 2 and 3 are the right stick, 4 and 5 the triggers, LB is 9."""

    def __init__(self, sdl):
        self.sdl = sdl
        what = Description(1, 1, 6, 11, 1, 0x046D, 0xC21F, 0, 0, 0, b"Logitech Gamepad F710")
        self.index = sdl.SDL_JoystickAttachVirtualEx(ctypes.byref(what))
        assert self.index >= 0

    def open(self):
        pad = self.sdl.SDL_JoystickGetDeviceInstanceID(self.index)
        self.sdl.SDL_JoystickFromInstanceID.restype = ctypes.c_void_p
        self.handle = ctypes.c_void_p(self.sdl.SDL_JoystickFromInstanceID(pad))

    def axis(self, index, value):
        self.sdl.SDL_JoystickSetVirtualAxis(self.handle, index, ctypes.c_int16(round(value * 32767)))

    def button(self, index, pressed):
        self.sdl.SDL_JoystickSetVirtualButton(self.handle, index, ctypes.c_uint8(pressed))

    def detach(self):
        self.sdl.SDL_JoystickDetachVirtual(self.index)


@pytest.fixture
def reader():
    sdl = Sdl(window=True, dummy=True)
    yield sdl
    sdl.close()


@pytest.fixture
def library(reader):
    found = re.search(r"\S*/libSDL2-\S*", MAPS.read_text()) if MAPS.exists() else None
    if found is None:
        pytest.skip("SDL's own library is not where this test looks for it")
    return ctypes.CDLL(found[0])


def test_a_virtual_pad_is_plugged_in_driven_and_unplugged(reader, library):
    source = PadSource(reader, {})
    source.poll(1.0, ready=True)
    pad = VirtualPad(library)
    for now_s in (1.1, 1.2, 1.3):
        inputs = source.poll(now_s, ready=True)
    assert (inputs.live, inputs.released, inputs.device) == (True, True, "Logitech F710 (X)")
    assert "no event since" in inputs.trouble, "where SDL says the axes are is no sign of life"
    pad.open()
    pad.button(9, pressed=True)
    pad.axis(1, -0.3)
    source.poll(1.35, ready=True)
    pad.axis(1, -0.5)
    pad.axis(2, 0.25)
    inputs = source.poll(1.4, ready=True)
    assert inputs.pressed == {Control.MANUAL}
    assert [inputs.speed, inputs.steering] == pytest.approx([0.5, -0.25], abs=0.01)
    assert inputs.event_s == 1.4
    assert source.poll(1.5, ready=True).event_s == 1.4, "SDL does not repeat what does not change"
    pad.detach()
    assert not source.poll(1.6, ready=True).live


def test_happenings_are_raw_and_the_usb_id_is_in_the_guid(reader, library):
    pad = VirtualPad(library)
    connected = next(one for one in reader.poll() if isinstance(one, PadConnected))
    assert usb_id(connected.guid) == "046d:c21f"
    assert connected.rest[4:] == [-1.0, -1.0]
    assert connected.mapping is not None
    pad.open()
    reader.poll()
    pad.button(3, pressed=True)
    pad.axis(0, -1.0)
    moved = reader.poll()
    assert PadMoved(connected.pad, Button(3, pressed=True)) in moved
    assert any(isinstance(one, PadMoved) and isinstance(one.event, Axis) and one.event.value < -0.99 for one in moved)
    pad.detach()
    assert Gone(connected.pad) in reader.poll()


def test_keys_of_the_window(reader):
    import pygame

    reader.poll()
    events = {
        (pygame.KEYDOWN, pygame.K_LSHIFT): Key("shift"),
        (pygame.KEYUP, pygame.K_RSHIFT): Key("shift", Act.RELEASE),
        (pygame.KEYDOWN, pygame.K_w): Key("w"),
        (pygame.KEYDOWN, pygame.K_UP): Key("up"),
        (pygame.KEYDOWN, pygame.K_SPACE): Key("space"),
        (pygame.KEYDOWN, pygame.K_ESCAPE): Key("escape"),
    }
    for kind, key in events:
        pygame.event.post(pygame.event.Event(kind, key=key))
    pygame.event.post(pygame.event.Event(pygame.WINDOWFOCUSLOST))
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    typed = [one.event for one in reader.poll() if isinstance(one, KeyTyped)]
    assert typed == [*events.values(), TerminalFocus(gained=False), Quit()]


def test_the_window_draws(reader):
    import pygame

    reader.show(["DRIVING", "speed"], "green")
    drawn = pygame.display.get_surface()
    assert drawn is not None
    assert drawn.get_bounding_rect().width > 0


def test_a_window_that_nobody_could_see_is_refused(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with pytest.raises(OSError, match="--keyboard"):
        Sdl(window=True)


def test_background_events_are_allowed():
    assert os.environ["SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS"] == "1"
