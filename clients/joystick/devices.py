"""Gamepads under /dev/input: found, opened, read and lost. Nothing here waits in the event loop.

Opening may wake a device, which takes milliseconds, and is done in a thread. Reading is done at the beat of the desk
and takes what is there, so that a pad that sends a thousand times a second costs no more than one that sends fifty.
"""

import asyncio
import fcntl
import logging
import os
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Never

from wallride.clients.joystick.evdev import ABS_HAT3Y, EV_ABS, EV_KEY, RECORD, EventReader, PadDescription
from wallride.clients.teleop.gamepad import Gone, Happening, PadConnected, PadMoved
from wallride.clients.teleop.pads import Axis, Button, Event

log = logging.getLogger("wallride.joystick")

FOLDER: Final = Path("/dev/input")
LOOK_EVERY_S: Final = 0.5
READ_BYTES: Final = 256 * RECORD.size
KEY_BYTES: Final = 0x300 // 8
ABS_BYTES: Final = 8
MAX_TRIES: Final = 10
"""How often a device is tried that may not be opened: udev gives it its group after it is there."""
_READ, _WRITE, _KIND = 2 << 30, 1 << 30, ord("E") << 8


def _request(direction: int, number: int, size: int) -> int:
    return direction | size << 16 | _KIND | number


class EvdevDevice:
    """A gamepad of the kernel. Grabbed: another program that reads it as well would be a second operator."""

    def __init__(self, path: Path) -> None:
        """Open it; OSError where that is not allowed, or it is gone."""
        self._file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            self.description = self._describe()
            if self.description.is_pad:
                with suppress(OSError):  # another program has it: both read it then
                    fcntl.ioctl(self._file, _request(_WRITE, 0x90, 4), 1)
        except OSError:
            os.close(self._file)
            raise

    def read(self) -> bytes:
        """Return the records that are there, b"" without any; OSError once the device is gone."""
        try:
            return os.read(self._file, READ_BYTES)
        except BlockingIOError:
            return b""

    def state(self) -> Sequence[tuple[int, int, int]]:
        """Return type, code and value of every control now; OSError once the device is gone."""
        down = set(_bits(self._ask(0x18, KEY_BYTES)))
        keys = [(EV_KEY, code, int(code in down)) for code in self.description.keys]
        return keys + [(EV_ABS, code, self._axis(code)[0]) for code in self.description.ranges]

    def close(self) -> None:
        """Close it."""
        os.close(self._file)

    def _describe(self) -> PadDescription:
        bus, vendor, product, version = struct.unpack("<4H", self._ask(0x02, 8))
        name = self._ask(0x06, 256).partition(b"\0")[0].decode(errors="replace")
        keys = _bits(self._ask(0x20 + EV_KEY, KEY_BYTES))
        codes = [code for code in _bits(self._ask(0x20 + EV_ABS, ABS_BYTES)) if code <= ABS_HAT3Y]
        ranges = {code: self._axis(code)[1:3] for code in codes}
        return PadDescription(name, (bus, vendor, product, version), keys, ranges)

    def _axis(self, code: int) -> tuple[int, int, int]:
        now, low, high, *_ = struct.unpack("<6i", self._ask(0x40 + code, 24))
        return now, low, high

    def _ask(self, number: int, size: int) -> bytes:
        return fcntl.ioctl(self._file, _request(_READ, number, size), bytes(size))


def _bits(raw: bytes) -> list[int]:
    return [8 * place + bit for place, byte in enumerate(raw) for bit in range(8) if byte >> bit & 1]


@dataclass(slots=True)
class _OpenPad:
    path: Path
    device: EvdevDevice
    reader: EventReader


@dataclass(slots=True)
class _Node:
    """A file that was tried. tries: how often it could not be opened."""

    number: int
    tries: int = 0


@dataclass(slots=True)
class LinuxPads:
    """The gamepads of this computer, as `wallride.clients.teleop.sources.PadSource` takes them.

    open_device: opens one; OSError where that is not possible.
    """

    folder: Path = FOLDER
    open_device: Callable[[Path], EvdevDevice] = EvdevDevice
    _pads: dict[int, _OpenPad] = field(default_factory=dict)
    _seen: dict[Path, _Node] = field(default_factory=dict)
    _happened: list[Happening] = field(default_factory=list)
    _opened: int = 0

    async def watch(self) -> Never:
        """Look for pads that come, for ever."""
        while True:
            if fresh := self.untried():
                for path, device in await asyncio.to_thread(self.open_all, fresh):
                    self.adopt(path, device)
            await asyncio.sleep(LOOK_EVERY_S)

    def untried(self) -> list[Path]:
        """Return the files that are to be opened: new ones, and those that were not allowed a moment ago."""
        try:
            there = {Path(entry): entry.inode() for entry in os.scandir(self.folder) if entry.name.startswith("event")}
        except OSError:
            there = {}
        held = {pad.path for pad in self._pads.values()}
        self._seen = {path: node for path, node in self._seen.items() if there.get(path) == node.number}
        for path, number in there.items():
            self._seen.setdefault(path, _Node(number))
        return [path for path, node in self._seen.items() if path not in held and node.tries < MAX_TRIES]

    def open_all(self, paths: Sequence[Path]) -> list[tuple[Path, EvdevDevice | None]]:
        """Open files, in a thread; None for one that could not be opened."""
        opened: list[tuple[Path, EvdevDevice | None]] = []
        for path in paths:
            try:
                opened.append((path, self.open_device(path)))
            except OSError as error:
                log.debug("%s: %s", path, error)
                opened.append((path, None))
        return opened

    def adopt(self, path: Path, device: EvdevDevice | None) -> None:
        """Take in what was opened; a device that is no gamepad is closed and not tried again."""
        node = self._seen.get(path)
        if node is not None:
            node.tries = node.tries + 1 if device is None else MAX_TRIES
        if device is None:
            return
        reader = EventReader(device.description)
        try:
            events = self._whole_state(device, reader) if device.description.is_pad and node is not None else None
        except OSError:
            events = None  # gone again
        if events is None:
            device.close()
            return
        self._opened += 1
        self._pads[self._opened] = _OpenPad(path, device, reader)
        axes = {event.index: event.value for event in events if isinstance(event, Axis)}
        described = device.description
        rest = [axes.get(index, 0.0) for index in range(len(described.axes()))]
        self._happened.append(PadConnected(self._opened, described.guid, described.name, rest, described.mapping()))
        held = [event for event in events if isinstance(event, Button) and event.pressed]
        self._happened += [PadMoved(self._opened, event) for event in held]

    def poll(self) -> list[Happening]:
        """Return what happened since the last call, in order; never waits."""
        happened, self._happened = self._happened, []
        for number, pad in list(self._pads.items()):
            try:
                for event in pad.reader.feed(pad.device.read()):
                    events = [event] if event is not None else self._whole_state(pad.device, pad.reader)
                    happened += [PadMoved(number, one) for one in events]
            except OSError as error:
                log.info("%s: %s", pad.path, error.strerror)
                del self._pads[number]
                self._seen.pop(pad.path, None)
                pad.device.close()
                happened.append(Gone(number))
        return happened

    @staticmethod
    def _whole_state(device: EvdevDevice, reader: EventReader) -> list[Event]:
        events = (reader.event(*control) for control in device.state())
        return [event for event in events if event is not None]
