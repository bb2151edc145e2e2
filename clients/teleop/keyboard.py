"""Keyboard inputs, in the two ways of keyboards. Pure: key events and a clock's readings in, inputs out.

`HeldKeys` is for keyboards that report when a key goes up (a window, or a terminal with kitty's protocol): hold Shift
or M as the deadman and drive with the arrows or WASD. `RepeatedKeys` is for all other terminals, which only repeat the
key that was pressed last: there the driving key is the deadman itself. It counts only once the repeats have begun and
for 0.15 s after the last, so that a tap never moves the car, and the pause before the first repeat is never bridged:
standing still for half a second is better than driving on for half a second.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

from wallride.clients.teleop.inputs import Control, Inputs
from wallride.runtime.wire.teleop import Input

REPEAT_GAP_S = 0.15
"""Maximum gap between repeats; the slowest usual rate is 11 a second."""
FAST_GAPS = 2
"""Number of consecutive quick repeats of a held key; a person does not tap so fast."""
CENTRED_START_S = 0.06
"""The driving key of a terminal first counts as the deadman alone, then also as the stick."""
SILENT_TERMINAL_S = 0.6
"""Timeout of a terminal's answer, after which it counts as one without key releases."""


class Act(StrEnum):
    """Kind of a key event."""

    PRESS = "press"
    REPEAT = "repeat"
    RELEASE = "release"
    TYPED = "typed"
    """A plain character: pasted, or of a terminal that reports no releases."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key by its name: a letter, up, down, left, right, space, escape, shift."""

    name: str
    act: Act = Act.PRESS


@dataclass(frozen=True, slots=True)
class TerminalFocus:
    """The window or the terminal got the keyboard, or lost it; releases are not reported without it."""

    gained: bool


@dataclass(frozen=True, slots=True)
class TerminalAnswer:
    """The terminal answered our question whether it is there. flags: of kitty's protocol, 0 when it has none."""

    flags: int


@dataclass(frozen=True, slots=True)
class Quit:
    """The operator wants to leave."""


KeyEvent = Key | TerminalFocus | TerminalAnswer | Quit

BUTTON_KEYS = {
    Control.MANUAL: frozenset({"shift", "m"}),
    Control.AUTONOMY: frozenset({"p"}),
    Control.ESTOP: frozenset({"space", "escape"}),
    Control.RESET: frozenset({"r"}),
    Control.TAKE_OVER: frozenset({"t"}),
}
HELD_NAMES = {
    Control.MANUAL: "Shift or M",
    Control.AUTONOMY: "P",
    Control.ESTOP: "Space or Esc",
    Control.RESET: "R",
    Control.TAKE_OVER: "T",
    Control.SPEED: "W/S or up/down",
    Control.STEERING: "A/D or left/right",
}
REPEATED_NAMES = HELD_NAMES | {
    Control.MANUAL: "W A S D Q E Z C or an arrow",
    Control.SPEED: "W/S or up/down",
    Control.STEERING: "A/D (Q, E: forward in a bend; Z, C: backward)",
}
DIRECTIONS: dict[str, tuple[float, float]] = {
    "up": (1, 0), "w": (1, 0), "down": (-1, 0), "s": (-1, 0),
    "left": (0, 1), "a": (0, 1), "right": (0, -1), "d": (0, -1),
    "q": (1, 1), "e": (1, -1), "z": (-1, 1), "c": (-1, -1),
}  # fmt: skip
"""Speed and steering of every driving key, positive forward and to the left."""


class HeldKeys:
    """Keys with true releases. answers: whether the terminal must keep answering to be trusted."""

    def __init__(self, device: str, *, answers: bool = False) -> None:
        self._device = device
        self._answers = answers
        self._answered_s = -math.inf
        self._down: set[str] = set()
        self._held_over: set[str] = set()
        self._focused = True
        self._event_s = self._stop_s = self._focus_s = -math.inf

    def feed(self, event: KeyEvent, now_s: float) -> None:
        """Process one event. Held is what was seen to go down: what was typed has no release."""
        match event:
            case Key(name, act):
                if act is Act.PRESS:
                    self._down.add(name)
                elif act is Act.RELEASE:
                    self._down.discard(name)
                    self._held_over.discard(name)
                elif act is Act.REPEAT and name not in self._down:
                    self._held_over.add(name)
                self._event_s = now_s
                if act is not Act.RELEASE and name in BUTTON_KEYS[Control.ESTOP]:
                    self._stop_s = now_s
            case TerminalFocus(gained):
                self._focused, self._focus_s = gained, now_s
                self._down.clear()
                self._held_over.clear()
            case TerminalAnswer():
                self._answered_s = now_s
            case Quit():
                self._down.clear()

    def inputs(self, now_s: float) -> Inputs:
        """Return what is held now."""
        trouble = ""
        stop = frozenset({Control.ESTOP} if now_s - self._stop_s <= REPEAT_GAP_S else ())
        if not self._focused:
            trouble = "the keyboard is elsewhere: click here"
        elif self._answers and now_s - self._answered_s > SILENT_TERMINAL_S:
            trouble = "the terminal does not answer: it could not tell us of a released key"
        elif self._held_over or now_s - self._focus_s <= REPEAT_GAP_S:  # what repeats was held before
            trouble = "a key is held from before: release it"
        if trouble:
            return Inputs(Input.KEYBOARD, live=False, pressed=stop, device=self._device, trouble=trouble)
        moves = [DIRECTIONS[name] for name in self._down if name in DIRECTIONS]
        return Inputs(
            Input.KEYBOARD,
            live=True,
            event_s=self._event_s,
            pressed=stop | {control for control, keys in BUTTON_KEYS.items() if keys & self._down},
            speed=_clamp(sum(speed for speed, _ in moves)),
            steering=_clamp(sum(steering for _, steering in moves)),
            device=self._device,
        )


class RepeatedKeys:
    """Keys of a terminal that knows no releases: one key at a time, held as long as it repeats quickly."""

    def __init__(self, device: str) -> None:
        self._device = device
        self._name = ""
        self._last_s = -math.inf
        self._quick = 0
        self._held_since_s: float | None = None
        self._stop_s = -math.inf

    def feed(self, event: KeyEvent, now_s: float) -> None:
        """Process one event; every arrival of a key is a press or a repeat, the terminal does not distinguish them."""
        if not isinstance(event, Key):
            return
        if event.name in BUTTON_KEYS[Control.ESTOP]:
            self._stop_s = now_s
        again = event.name == self._name and now_s - self._last_s <= REPEAT_GAP_S
        self._quick = self._quick + 1 if again else 0
        if not again:
            self._held_since_s = None
        elif self._quick >= FAST_GAPS and self._held_since_s is None:
            self._held_since_s = now_s
        self._name, self._last_s = event.name, now_s

    def inputs(self, now_s: float) -> Inputs:
        """Return what counts as held now."""
        if now_s - self._last_s > REPEAT_GAP_S:
            self._held_since_s, self._quick = None, 0
        held = self._name if self._held_since_s is not None else ""
        speed, steering = DIRECTIONS.get(held, (0.0, 0.0))
        if self._held_since_s is None or now_s - self._held_since_s < CENTRED_START_S:
            speed = steering = 0.0
        return Inputs(
            Input.KEYBOARD,
            live=True,
            event_s=self._last_s,
            pressed=self._pressed(held, now_s),
            speed=speed,
            steering=steering,
            device=self._device,
        )

    def _pressed(self, held: str, now_s: float) -> frozenset[Control]:
        keys = BUTTON_KEYS | {Control.MANUAL: frozenset(DIRECTIONS), Control.ESTOP: frozenset()}
        pressed = {control for control, names in keys.items() if held in names}
        if now_s - self._stop_s <= REPEAT_GAP_S:
            pressed.add(Control.ESTOP)
        return frozenset(pressed)


def _clamp(value: float) -> float:
    return max(-1.0, min(value, 1.0))
