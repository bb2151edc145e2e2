"""Linux's input events as events of a pad. Pure: bytes and a description in, `wallride.clients.teleop.pads` events out.

SDL's order of buttons and axes is kept (buttons from 0x120 by code, then the lower ones; axes by code without hats), so
that the layouts of `pads`, and those that `wallride teleop --map` wrote, are the same here. Codes are those of
linux/input-event-codes.h; what they mean on a gamepad is in the kernel's Documentation/input/gamepad.rst.
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from wallride.clients.teleop.pads import Axis, Button, Event, Hat

RECORD: Final = struct.Struct("@llHHi")
"""struct input_event: seconds, microseconds, type, code, value."""
EV_SYN, EV_KEY, EV_ABS = 0, 1, 3
SYN_REPORT, SYN_DROPPED = 0, 3
ABS_X, ABS_Y, ABS_Z, ABS_RX, ABS_GAS, ABS_BRAKE = 0, 1, 2, 3, 9, 10
ABS_HAT0X, ABS_HAT3Y = 0x10, 0x17
BTN_JOYSTICK, BTN_DIGI = 0x120, 0x140
BTN_SOUTH, BTN_EAST, BTN_NORTH, BTN_WEST, BTN_TL, BTN_TR, BTN_START = 0x130, 0x131, 0x133, 0x134, 0x136, 0x137, 0x13B
SONY: Final = 0x054C
KERNEL_DRIVER: Final = 0x8000
"""Bit of the version by which the kernel's driver for Sony's pads says that it orders axes as gamepads do."""
REPEATED: Final = 2
"""Value of a key that is held and repeats itself; it says nothing new."""


@dataclass(frozen=True, slots=True)
class PadDescription:
    """What an input device says of itself.

    identity: bus, vendor, product, version. keys: codes of its buttons. ranges: minimum and maximum by code of an axis.
    """

    name: str
    identity: tuple[int, int, int, int]
    keys: Sequence[int]
    ranges: Mapping[int, tuple[int, int]]

    @property
    def is_pad(self) -> bool:
        """Whether it has a stick, and the buttons of a joystick or gamepad; a pad's touch field and gyro have not."""
        return {ABS_X, ABS_Y} <= self.ranges.keys() and any(BTN_JOYSTICK <= key < BTN_DIGI for key in self.keys)

    @property
    def guid(self) -> str:
        """Return SDL's name of this kind of pad."""
        return "".join(struct.pack("<H", number).hex() + "0000" for number in self.identity)

    def buttons(self) -> dict[int, int]:
        """Return the number of each button by code, as SDL counts them."""
        ordered = sorted(self.keys, key=lambda code: (code < BTN_JOYSTICK, code))
        return {code: index for index, code in enumerate(ordered)}

    def axes(self) -> dict[int, int]:
        """Return the number of each axis by code, as SDL counts them."""
        codes = sorted(code for code in self.ranges if not ABS_HAT0X <= code <= ABS_HAT3Y)
        return {code: index for index, code in enumerate(codes)}

    def mapping(self) -> dict[str, str] | None:
        """Return the places of the controls in SDL's notation; None for a device that is not ordered as a gamepad.

        The kernel's driver for Xbox pads calls Y what is west on a pad. By Bluetooth their right stick is on Z and RZ,
        and the triggers are gas and brake.
        """
        _, vendor, _, version = self.identity
        buttons, axes = self.buttons(), self.axes()
        right = ABS_Z if {ABS_GAS, ABS_BRAKE} <= axes.keys() and ABS_RX not in axes else ABS_RX
        y = BTN_NORTH if vendor == SONY else BTN_WEST
        named = {"b": BTN_EAST, "y": y, "leftshoulder": BTN_TL, "rightshoulder": BTN_TR, "start": BTN_START}
        foreign = vendor == SONY and not version & KERNEL_DRIVER
        if foreign or BTN_SOUTH not in buttons or right not in axes or not buttons.keys() >= set(named.values()):
            return None
        places = {name: f"b{buttons[code]}" for name, code in named.items()}
        return places | {"lefty": f"a{axes[ABS_Y]}", "rightx": f"a{axes[right]}"}


class EventReader:
    """Turns the records of one device into events."""

    def __init__(self, description: PadDescription) -> None:
        self._buttons = description.buttons()
        self._axes = description.axes()
        self._ranges = description.ranges
        self._hats: dict[int, list[int]] = {}
        self._dropped = False

    def feed(self, data: bytes) -> Iterator[Event | None]:
        """Yield the events of whole records; None where the kernel dropped some: then the state must be asked for."""
        for _, _, kind, code, number in RECORD.iter_unpack(data[: len(data) - len(data) % RECORD.size]):
            if kind == EV_SYN and code == SYN_DROPPED:
                self._dropped = True
            elif self._dropped:
                if kind == EV_SYN and code == SYN_REPORT:
                    self._dropped = False
                    yield None
            elif (event := self.event(kind, code, number)) is not None:
                yield event

    def event(self, kind: int, code: int, number: int) -> Event | None:
        """Return the event of one record; None for what is no control of a pad."""
        if kind == EV_KEY and code in self._buttons and number != REPEATED:
            return Button(self._buttons[code], pressed=bool(number))
        if kind != EV_ABS or code not in self._ranges:
            return None
        if code not in self._axes:
            index, upright = divmod(code - ABS_HAT0X, 2)
            hat = self._hats.setdefault(index, [0, 0])
            hat[upright] = -number if upright else number  # SDL: up is positive; Linux: down
            return Hat(index, *hat)
        low, high = self._ranges[code]
        return Axis(self._axes[code], max(-1.0, min((number - low) / (high - low) * 2 - 1, 1.0)) if high > low else 0.0)
