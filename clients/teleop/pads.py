"""Meaning of a pad's raw axes, buttons and hats. Pure: events in, inputs out.

Raw values are SDL's: axes -1 to 1 with up and left negative, hats with up +1. A layout gives in SDL's own notation the
place of each control ("b4" a button, "a1~" an axis turned round, "+a2" half an axis, "h0.1" a direction of the hat).
Pads are known by their USB id, never by their index.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from wallride.clients.teleop.inputs import CENTRED, STICKS, Control

PRESSED = 0.5
"""Threshold of an axis that stands for a button (a trigger)."""
JUMP = 0.9
"""Minimum first step of a trigger that rests at its end; a stick begins to move in small steps."""
BINDING = re.compile(r"(?P<half>[+-]?)a(?P<axis>\d+)(?P<turned>~?)|b(?P<button>\d+)|h(?P<hat>\d+)\.(?P<mask>[1248])")


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis moved: -1 to 1."""

    index: int
    value: float


@dataclass(frozen=True, slots=True)
class Button:
    """A button went down or up."""

    index: int
    pressed: bool


@dataclass(frozen=True, slots=True)
class Hat:
    """The D-pad moved: x right, y up, each -1, 0 or 1."""

    index: int
    x: int
    y: int


Event = Axis | Button | Hat


@dataclass(frozen=True, slots=True)
class Binding:
    """Place of one control. half: 0 the whole axis, else only its positive or negative part."""

    kind: str
    index: int
    half: int = 0
    sign: int = 1
    mask: int = 0

    def __str__(self) -> str:
        if self.kind == "h":
            return f"h{self.index}.{self.mask}"
        half = {0: "", 1: "+", -1: "-"}[self.half]
        return f"{half}{self.kind}{self.index}{'~' if self.sign < 0 else ''}"


@dataclass(frozen=True, slots=True)
class Layout:
    """Places of all controls of one kind of pad. origin: source of the layout, for the screen."""

    name: str
    bindings: Mapping[Control, Binding]
    origin: str


class LayoutError(ValueError):
    """An invalid layout; one line with the fault and the remedy."""


class PadState:
    """State of a pad since it was connected.

    events, last_event_s: how many, and when the last came (-inf before the first).
    """

    def __init__(self) -> None:
        self.axes: dict[int, float] = {}
        self.buttons: set[int] = set()
        self.hats: dict[int, tuple[int, int]] = {}
        self.events = 0
        self.last_event_s = -math.inf
        self._jumped: set[int] = set()
        self._moved: set[int] = set()

    def rest(self, axis: int, value: float) -> None:
        """Set the value of an axis when the pad was opened; it is no sign of life."""
        self.axes[axis] = value

    def apply(self, event: Event, now_s: float) -> None:
        """Process one event. SDL repeats the place of an axis when a pad is opened; that is no sign of life."""
        if isinstance(event, Axis) and self.axes.get(event.index) == event.value:
            return
        self.events += 1
        self.last_event_s = now_s
        match event:
            case Axis(index, value):
                self._watch_jump(index, value)
                self.axes[index] = value
            case Button(index, pressed):
                (self.buttons.add if pressed else self.buttons.discard)(index)
            case Hat(index, x, y):
                self.hats[index] = (x, y)

    def read(self, binding: Binding) -> float:
        """Return one control: -1 to 1 for a whole axis, 0 to 1 for the rest; NaN for an untrusted axis."""
        if binding.kind == "b":
            return float(binding.index in self.buttons)
        if binding.kind == "h":
            x, y = self.hats.get(binding.index, (0, 0))
            return float({1: y > 0, 2: x > 0, 4: y < 0, 8: x < 0}[binding.mask])
        value = self.axes.get(binding.index, 0.0)
        if binding.half:
            return max(0.0, value * binding.half)
        return math.nan if binding.index in self._jumped else value * binding.sign

    def is_down(self, binding: Binding) -> bool:
        """Return whether a control used as a button is pressed."""
        value = self.read(binding)
        return value > PRESSED

    def _watch_jump(self, index: int, value: float) -> None:
        if index not in self._moved and abs(value) > JUMP and abs(self.axes.get(index, 0.0)) <= CENTRED:
            self._jumped.add(index)
        elif abs(value) <= CENTRED:
            self._jumped.discard(index)
        self._moved.add(index)


def parse_binding(text: str) -> Binding:
    """Parse SDL's notation; LayoutError for an invalid text."""
    match = BINDING.fullmatch(text)
    if match is None:
        raise LayoutError(f"{text!r} is no control: write b4 for a button, a1 or a1~ for an axis, h0.1 for the D-pad")
    if match["button"] is not None:
        return Binding("b", int(match["button"]))
    if match["hat"] is not None:
        return Binding("h", int(match["hat"]), mask=int(match["mask"]))
    half = {"": 0, "+": 1, "-": -1}[match["half"]]
    return Binding("a", int(match["axis"]), half=half, sign=-1 if match["turned"] else 1)


def layout(name: str, texts: Mapping[str, str], origin: str) -> Layout:
    """Return a checked layout from the notation of every control; LayoutError when it cannot drive."""
    unknown = sorted(set(texts) - set(Control))
    if unknown:
        raise LayoutError(f"{unknown[0]!r} is no control; there are {', '.join(Control)}")
    bindings = {Control(control): parse_binding(text) for control, text in texts.items()}
    for control in Control:
        if control not in bindings:
            raise LayoutError(f"{control.value} is missing: run wallride teleop --map")
    for stick in STICKS:
        if bindings[stick].kind != "a" or bindings[stick].half:
            raise LayoutError(f"{stick.value} = {bindings[stick]}: must be a whole axis, like a1 or a1~")
    places = [(binding.kind, binding.index, binding.half, binding.mask) for binding in bindings.values()]
    if len(set(places)) != len(places):
        raise LayoutError("two controls are in the same place: run wallride teleop --map")
    return Layout(name, bindings, origin)


SDL_NAMES: Mapping[Control, str] = {
    Control.SPEED: "lefty",
    Control.STEERING: "rightx",
    Control.MANUAL: "leftshoulder",
    Control.AUTONOMY: "rightshoulder",
    Control.ESTOP: "b",
    Control.RESET: "start",
    Control.TAKE_OVER: "y",
}


def from_sdl(name: str, mapping: Mapping[str, str]) -> Layout:
    """Return the layout that SDL's database describes; LayoutError when the pad lacks a required control."""
    texts = {}
    for control, sdl_name in SDL_NAMES.items():
        text = mapping.get(sdl_name)
        if text is None:
            raise LayoutError(f"{name}: SDL knows no {sdl_name} on it; run wallride teleop --map")
        if control in STICKS:  # SDL: up and left are negative; ours: forward and left are positive
            text = text.removesuffix("~") if text.endswith("~") else text + "~"
        texts[control.value] = text
    return layout(name, texts, "SDL's database")


def parse_mapping(line: str) -> dict[str, str]:
    """Read a line of SDL's database: GUID, name, then control:place pairs."""
    return dict(pair.split(":", 1) for pair in line.split(",")[2:] if ":" in pair)


def usb_id(guid: str) -> str:
    """Return "vendor:product" of an SDL GUID: little-endian 16-bit words at bytes 4 and 8; "" when it has none."""
    try:
        raw = bytes.fromhex(guid)
    except ValueError:
        return ""
    if len(raw) != 16:
        return ""
    return f"{int.from_bytes(raw[4:6], 'little'):04x}:{int.from_bytes(raw[8:10], 'little'):04x}"


F710: Mapping[str, tuple[str, str]] = {
    "046d:c21f": (
        "Logitech F710 (X)",
        "a:b0,b:b1,y:b3,leftshoulder:b4,rightshoulder:b5,start:b7,leftx:a0,lefty:a1,rightx:a3,righty:a4",
    ),
    "046d:c219": (
        "Logitech F710 (D)",
        "a:b1,b:b2,y:b3,leftshoulder:b4,rightshoulder:b5,start:b9,leftx:a0,lefty:a1,rightx:a2,righty:a3",
    ),
}
"""Both positions of the F710's switch as Linux shows them, for when SDL does not know it."""


def choose(guid: str, name: str, own: Mapping[str, Layout], sdl_mapping: Mapping[str, str] | None) -> Layout:
    """Return the layout for a pad: the user's own file first, then SDL's database, then the F710's tables.

    own: by GUID or by USB id. LayoutError when the pad is unknown.
    """
    usb = usb_id(guid)
    for key in (guid, usb):
        if key in own:
            return own[key]
    known = F710.get(usb)
    if sdl_mapping:
        return from_sdl(known[0] if known else name, sdl_mapping)
    if known:
        return from_sdl(known[0], parse_mapping(f"{guid},{known[0]},{known[1]}"))
    raise LayoutError(f"{name} ({usb or guid}) is unknown: run wallride teleop --map")
