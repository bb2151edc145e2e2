"""SDL, through pygame-ce: pads that come and go, and a window for the keyboard. The only importer of pygame.

All of SDL's events are converted into our own events here; their meaning is decided elsewhere.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from wallride.clients.teleop.keyboard import Act, Key, KeyEvent, Quit, TerminalFocus
from wallride.clients.teleop.pads import Axis, Button, Event, Hat

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")  # the deadman is in a hand, not in a window's focus

WINDOW_SIZE = (760, 300)
LINE_PX = 22
UNSEEN_DRIVERS = frozenset({"dummy", "offscreen", "evdev"})
"""Fallback drivers of SDL without a display: their window cannot be seen or typed into."""
KEY_NAMES = {"left shift": "shift", "right shift": "shift"}
COLOURS = {"red": (235, 80, 80), "yellow": (235, 200, 80), "green": (90, 210, 110)}


@dataclass(frozen=True, slots=True)
class PadConnected:
    """A pad was connected. rest: its axes at this moment. mapping: SDL's, None when its database lacks the pad."""

    pad: int
    guid: str
    name: str
    rest: Sequence[float]
    mapping: Mapping[str, str] | None


@dataclass(frozen=True, slots=True)
class Gone:
    """A pad was unplugged."""

    pad: int


@dataclass(frozen=True, slots=True)
class PadMoved:
    """A control of a pad moved."""

    pad: int
    event: Event


@dataclass(frozen=True, slots=True)
class KeyTyped:
    """A key event of the window."""

    event: KeyEvent


Happening = PadConnected | Gone | PadMoved | KeyTyped


class Sdl:
    """SDL's event queue. window: open one, for a keyboard with real releases; otherwise no display is needed."""

    def __init__(self, *, window: bool = False, dummy: bool = False) -> None:
        """Open SDL; OSError with the way out when it cannot. dummy: the window is a test's, on no display."""
        if not window or dummy:
            os.environ["SDL_VIDEODRIVER"] = "dummy"
        import pygame
        from pygame._sdl2 import controller

        self._pygame = pygame
        self._controller = controller
        try:
            pygame.display.init()
            pygame.joystick.init()
            controller.init()
            self._screen = self._open_window(unseen=dummy) if window else None
        except pygame.error as error:
            hint = ": a window needs one; use --keyboard in a terminal, or a pad" if window else ""
            raise OSError(f"{error}{hint}") from None
        self._open: dict[int, Any] = {}

    def poll(self) -> list[Happening]:
        """Return the events since the last call, in order; never waits."""
        return [happening for event in self._pygame.event.get() if (happening := self._translate(event)) is not None]

    def show(self, lines: Sequence[str], mood: str) -> None:
        """Draw text into the window, the first line in the colour of a mood."""
        if self._screen is None:
            return
        self._screen.fill((24, 24, 28))
        for row, line in enumerate(lines):
            colour = COLOURS.get(mood, (220, 220, 220)) if row == 0 else (220, 220, 220)
            self._screen.blit(self._font.render(line, True, colour), (12, 10 + row * LINE_PX))  # noqa: FBT003 - pygame's
        self._pygame.display.flip()

    def close(self) -> None:
        """Close every device."""
        self._pygame.quit()

    def _open_window(self, *, unseen: bool) -> Any:  # noqa: ANN401 - pygame is imported late
        pygame = self._pygame
        if not unseen and pygame.display.get_driver() in UNSEEN_DRIVERS:
            raise pygame.error("no display")
        pygame.font.init()
        self._font = pygame.font.Font(None, 24)
        screen = pygame.display.set_mode(WINDOW_SIZE)
        pygame.display.set_caption("wallride teleop")
        return screen

    def _translate(self, event: Any) -> Happening | None:  # noqa: ANN401 - pygame is imported late
        pygame = self._pygame
        if event.type == pygame.JOYDEVICEADDED:
            return self._connect(event.device_index)
        if event.type == pygame.JOYDEVICEREMOVED:
            self._open.pop(event.instance_id, None)
            return Gone(event.instance_id)
        if event.type == pygame.JOYAXISMOTION:
            return PadMoved(event.instance_id, Axis(event.axis, event.value))
        if event.type in {pygame.JOYBUTTONDOWN, pygame.JOYBUTTONUP}:
            return PadMoved(event.instance_id, Button(event.button, event.type == pygame.JOYBUTTONDOWN))
        if event.type == pygame.JOYHATMOTION:
            return PadMoved(event.instance_id, Hat(event.hat, *event.value))
        key_event = self._translate_key(event)
        return KeyTyped(key_event) if key_event is not None else None

    def _translate_key(self, event: Any) -> KeyEvent | None:  # noqa: ANN401 - pygame is imported late
        pygame = self._pygame
        if event.type in {pygame.KEYDOWN, pygame.KEYUP}:
            name = pygame.key.name(event.key)
            act = Act.PRESS if event.type == pygame.KEYDOWN else Act.RELEASE
            return Key(KEY_NAMES.get(name, name), act)
        if event.type in {pygame.WINDOWFOCUSLOST, pygame.WINDOWFOCUSGAINED}:
            return TerminalFocus(gained=event.type == pygame.WINDOWFOCUSGAINED)
        return Quit() if event.type in {pygame.QUIT, pygame.WINDOWCLOSE} else None

    def _connect(self, index: int) -> Happening | None:
        try:
            stick = self._pygame.joystick.Joystick(index)
            mapping = None
            if self._controller.is_controller(index):
                mapping = dict(self._controller.Controller.from_joystick(stick).get_mapping())
            rest = [stick.get_axis(axis) for axis in range(stick.get_numaxes())]
        except self._pygame.error:  # unplugged again in the meantime; its removal follows
            return None
        pad = stick.get_instance_id()
        self._open[pad] = stick  # SDL sends events of opened pads only
        return PadConnected(pad, stick.get_guid(), stick.get_name(), rest, mapping)
