"""Input sources, each polled fifty times a second: a pad, a keyboard, a window, a script."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

from wallride.clients.teleop import gamepad
from wallride.clients.teleop.advice import PAD_NAMES
from wallride.clients.teleop.inputs import BUTTONS, Control, Inputs
from wallride.clients.teleop.keyboard import (
    BUTTON_KEYS,
    HELD_NAMES,
    REPEATED_NAMES,
    HeldKeys,
    Key,
    KeyEvent,
    Quit,
    RepeatedKeys,
)
from wallride.clients.teleop.pads import Axis, Event, Hat, Layout, LayoutError, PadState, choose, usb_id
from wallride.clients.teleop.script import Script
from wallride.runtime.wire.teleop import Input

FAMILY = frozenset({"046d:c21f", "046d:c219", "046d:c21d", "046d:c216", "046d:c21e", "046d:c218"})
"""F710, F310 and F510, each in X and in D mode."""
REST = 0.1
END = 0.95
EXCURSIONS = 3
KEY_STOP_S = 0.2
"""Duration for which a typed Space counts as the e-stop button held; the pilot repeats it until the car confirms."""
PLUG_IN = "no pad: plug one in, or start again with --window"
NO_PAD = "no gamepad: the keyboard drives"
LOST_PAD = "the gamepad is gone: plug it in, or press a key to drive with the keyboard"


class ModeWatch:
    """Watches one pad's events for the MODE button of Logitech's pads, which swaps the left stick with the D-pad.

    The throttle then dies, or is on/off. The wire carries no state of it, so it is inferred: a D-pad that moves while
    the stick never does, or a stick that reports only its ends. axis: the raw axis of the left stick's up and down.
    """

    def __init__(self, axis: int) -> None:
        self._axis = axis
        self._between = False
        self._ends = 0
        self._last = 0.0
        self._hat_moves = 0

    def watch(self, event: Event) -> None:
        """Process one event."""
        match event:
            case Axis(index, value) if index == self._axis:
                if REST < abs(value) < END:
                    self._between, self._hat_moves, self._ends = True, 0, 0
                elif abs(value) >= END > abs(self._last) and not self._between:
                    self._ends += 1
                elif abs(value) <= REST:
                    self._between = False
                self._last = value
            case Hat(_, x, y) if (x, y) != (0, 0):
                self._hat_moves += 1
            case _:
                pass

    @property
    def notice(self) -> str:
        """Return a notice for the operator, "" when all is well."""
        if self._ends >= EXCURSIONS:
            return "the left stick is on/off only: press MODE on the pad (its light must be off)"
        if self._hat_moves >= EXCURSIONS and abs(self._last) <= REST:
            return "the D-pad does nothing here; if that was the left stick, press MODE (its light must be off)"
        return ""


class KeyReader(Protocol):
    """A terminal, or nothing."""

    def poll(self) -> list[KeyEvent]:
        """Return what was typed since the last call."""


class Pads(Protocol):
    """SDL, or a recording of it."""

    def poll(self) -> list[gamepad.Happening]:
        """Return what happened since the last call."""


class Window(Pads, Protocol):
    """A window with a keyboard in it."""

    def show(self, lines: Sequence[str], mood: str) -> None:
        """Draw text."""


class InputSource(Protocol):
    """Device of an operator.

    names: labels of its controls. leaving: the operator quits. window: shows the screen as well, None without one.
    """

    names: Mapping[Control, str] = PAD_NAMES
    leaving: bool = False
    window: Window | None = None

    def poll(self, now_s: float, *, ready: bool) -> Inputs:
        """Return what is held now. ready: a deadman would count."""


class PadSource(InputSource):
    """The first usable pad. While it is away nothing counts, and whatever comes back starts from nothing.

    own: layouts from the user's files. wanted: part of a name or a USB id that the pad must have, "" for any.
    """

    def __init__(self, pads: Pads, own: Mapping[str, Layout], wanted: str = "") -> None:
        self._pads = pads
        self._own = own
        self._wanted = wanted.lower()
        self._there: dict[int, gamepad.PadConnected] = {}
        self._states: dict[int, PadState] = {}
        self._unusable: dict[int, str] = {}
        self._pad: int | None = None
        self._layout: Layout | None = None
        self._state = PadState()
        self._mode: ModeWatch | None = None
        self._away = Inputs(Input.PAD, live=False, trouble=PLUG_IN)

    @property
    def has_pad(self) -> bool:
        """Return whether a usable pad is connected."""
        return self._pad is not None

    def poll(self, now_s: float, *, ready: bool) -> Inputs:  # noqa: ARG002 - a pad does not wait for the car
        """Poll SDL and return the held inputs."""
        for happening in self._pads.poll():
            self._take(happening, now_s)
        if self._pad is None:
            self._adopt()
            if (trouble := "; ".join(self._unusable.values()) or PLUG_IN) != self._away.trouble:
                self._away = replace(self._away, trouble=trouble)
            return self._away
        return self._read()

    def _take(self, happening: gamepad.Happening, now_s: float) -> None:
        match happening:
            case gamepad.PadConnected(pad):
                self._there[pad], self._states[pad] = happening, PadState()
                for axis, value in enumerate(happening.rest):
                    self._states[pad].rest(axis, value)
            case gamepad.Gone(pad):
                self._there.pop(pad, None)
                self._states.pop(pad, None)
                self._unusable.pop(pad, None)
                if pad == self._pad:
                    self._pad = None
            case gamepad.PadMoved(pad, event) if pad in self._states:  # also before it is adopted: what is held is held
                self._states[pad].apply(event, now_s)
                if pad == self._pad and self._mode is not None:
                    self._mode.watch(event)
            case _:
                pass

    def _adopt(self) -> None:
        """Take the first pad that can be used; it counts from the next poll on."""
        for pad, found in self._there.items():
            usb = usb_id(found.guid)
            if self._wanted and self._wanted not in f"{found.name} {usb}".lower():
                self._unusable[pad] = f"{found.name} ({usb}) is not the --pad that you want"
                continue
            try:
                self._layout = choose(found.guid, found.name, self._own, found.mapping)
            except LayoutError as error:
                self._unusable[pad] = str(error)
                continue
            self._pad, self._state = pad, self._states[pad]
            stick = self._layout.bindings[Control.SPEED].index
            self._mode = ModeWatch(stick) if usb in FAMILY else None
            return

    def _read(self) -> Inputs:
        assert self._layout is not None  # noqa: S101 - adopted together with the pad
        state, at = self._state, self._layout.bindings
        return Inputs(
            Input.PAD,
            live=True,
            event_s=state.last_event_s,
            pressed=frozenset(control for control in BUTTONS if state.is_down(at[control])),
            speed=state.read(at[Control.SPEED]),
            steering=state.read(at[Control.STEERING]),
            device=self._layout.name,
            trouble=self._trouble(),
        )

    def _trouble(self) -> str:
        if not self._state.events:
            return "no event since it was connected: is it switched on? Press a button (a car here keeps its pad)"
        return self._mode.notice if self._mode is not None else ""


class PadOrKeySource(InputSource):
    """A pad while there is one, else the keyboard of this terminal, whose Space and Esc stop in either case.

    A pad that is lost is no release, so the keyboard takes over from it only when a key is pressed there.
    steering_per_s: how fast a key moves the stick that it stands for.
    """

    def __init__(self, pads: PadSource, keys: "KeySource", steering_per_s: float) -> None:
        self.names = keys.names
        self._pads = pads
        self._keys = keys
        self._steering_per_s = steering_per_s
        self._steering = 0.0
        self._polled_s = float("-inf")
        self._on_keys = True

    def poll(self, now_s: float, *, ready: bool) -> Inputs:
        """Return what is held on the present device."""
        from_pad, from_keys = self._pads.poll(now_s, ready=ready), self._keys.poll(now_s, ready=ready)
        stop = (from_pad.pressed | from_keys.pressed) & {Control.ESTOP}
        self._on_keys = not self._pads.has_pad and (self._on_keys or not from_keys.released)
        self.names = (self._keys if self._on_keys else self._pads).names
        self.leaving = self._keys.leaving
        if not self._on_keys:
            trouble = from_pad.trouble.replace(PLUG_IN, LOST_PAD)
            return replace(from_pad, pressed=from_pad.pressed | stop, trouble=trouble)
        return replace(self._steered(from_keys, now_s), pressed=from_keys.pressed | stop)

    def _steered(self, keys: Inputs, now_s: float) -> Inputs:
        """Return the keys with a stick that moves gradually, and centres at once."""
        step = self._steering_per_s * max(0.0, now_s - self._polled_s)
        self._polled_s = now_s
        self._steering += max(-step, min(keys.steering - self._steering, step))
        if not keys.steering:
            self._steering = 0.0
        return replace(keys, steering=self._steering, trouble=keys.trouble or NO_PAD)


class StopKeySource(InputSource):
    """Another source, with the Space and Esc of a terminal as an e-stop besides. leaving: also at the other's end."""

    def __init__(self, source: InputSource, keys: KeyReader) -> None:
        self.names, self.window = source.names, source.window
        self._source = source
        self._keys = keys
        self._stop_s = float("-inf")

    def poll(self, now_s: float, *, ready: bool) -> Inputs:
        """Return what the other source holds, and the e-stop."""
        for event in self._keys.poll():
            self.leaving |= isinstance(event, Quit)
            if isinstance(event, Key) and event.name in BUTTON_KEYS[Control.ESTOP]:
                self._stop_s = now_s
        inputs = self._source.poll(now_s, ready=ready)
        self.leaving |= self._source.leaving
        stopped = now_s - self._stop_s < KEY_STOP_S
        return replace(inputs, pressed=inputs.pressed | {Control.ESTOP}) if stopped else inputs


class KeySource(InputSource):
    """The keyboard of this terminal. releases: the terminal reports when a key goes up."""

    def __init__(self, keys: KeyReader, *, releases: bool) -> None:
        self.names = HELD_NAMES if releases else REPEATED_NAMES
        self._keys = keys
        self._state: HeldKeys | RepeatedKeys = (
            HeldKeys("keyboard", answers=True)
            if releases
            else RepeatedKeys("keyboard without releases: a driving key counts once it repeats; --window is better")
        )

    def poll(self, now_s: float, *, ready: bool) -> Inputs:  # noqa: ARG002 - a keyboard does not wait for the car
        """Take what was typed and return what is held."""
        for event in self._keys.poll():
            self.leaving |= isinstance(event, Quit)
            self._state.feed(event, now_s)
        return self._state.inputs(now_s)


class WindowSource(InputSource):
    """A window of its own: true releases, and everything released when it loses the focus."""

    names = HELD_NAMES

    def __init__(self, sdl: Window) -> None:
        self.window = self._sdl = sdl
        self._state = HeldKeys("keyboard in a window")

    def poll(self, now_s: float, *, ready: bool) -> Inputs:  # noqa: ARG002 - a keyboard does not wait for the car
        """Take what was typed into the window and return what is held."""
        for happening in self._sdl.poll():
            if isinstance(happening, gamepad.KeyTyped):
                self.leaving |= isinstance(happening.event, Quit)
                self._state.feed(happening.event, now_s)
        return self._state.inputs(now_s)


class ScriptSource(InputSource):
    """A script; its time begins at the first `poll` with a ready car, and it leaves at its end."""

    def __init__(self, script: Script) -> None:
        self._script = script
        self._start_s: float | None = None

    def poll(self, now_s: float, *, ready: bool) -> Inputs:
        """Return what the script holds now."""
        if self._start_s is None and ready:
            self._start_s = now_s
        elapsed_s = -1.0 if self._start_s is None else now_s - self._start_s
        self.leaving = elapsed_s >= self._script.duration_s
        return self._script.inputs(elapsed_s, now_s)
