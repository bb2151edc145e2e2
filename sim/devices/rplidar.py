"""State machine of an RPLIDAR and the encoding of its streams; deliberately not built on the driver's codec.

What both share is only the golden bytes that their tests check them against.
"""

import math
import struct
from dataclasses import dataclass
from functools import reduce
from operator import xor
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.sim.devices.ultra_capsules import ultra_dense_cabin, ultra_words

Millimetres = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

PLAIN, EXPRESS, ULTRA, DENSE, ULTRA_DENSE = 0x81, 0x82, 0x84, 0x85, 0x86
_LENGTHS: Final = {PLAIN: 5, EXPRESS: 84, ULTRA: 132, DENSE: 84, ULTRA_DENSE: 170}
_SAMPLES: Final = {PLAIN: 1, EXPRESS: 32, ULTRA: 96, DENSE: 40, ULTRA_DENSE: 64}
_SERIAL: Final = bytes(range(16))
_GOOD, _PROTECTED = 0, 2
_LASER_M, _LASER_RAD = 0.02401, math.radians(8.0)
"""An ultra capsule's laser begins so far beside the receiver, and is turned toward its axis by so much."""


@dataclass(frozen=True, slots=True)
class RplidarModel:
    """Identity and stream of one model. firmware: (major, minor). motor: "line", "board", "speed" or "built in"."""

    name: str
    code: int
    firmware: tuple[int, int]
    hardware: int
    stream: int
    sample_us: float
    range_max_m: float
    turns_hz: float
    baud: int
    motor: str
    mode: int = 2
    mode_name: str = "Boost"
    configurable: bool = True

    @property
    def sample_s(self) -> float:
        """Return the time between two samples."""
        return self.sample_us * 1e-6


A1: Final = RplidarModel("A1", 0x18, (1, 29), 7, EXPRESS, 127.0, 12.0, 8.0, 115200, "line")
A1_OLD: Final = RplidarModel("A1 old", 0x18, (1, 20), 0, EXPRESS, 254.0, 12.0, 5.5, 115200, "line", configurable=False)
A1_OLDEST: Final = RplidarModel("A1 1.5", 0x18, (1, 5), 0, PLAIN, 500.0, 6.0, 5.5, 115200, "line", configurable=False)
A2: Final = RplidarModel("A2", 0x28, (1, 29), 6, EXPRESS, 125.0, 12.0, 10.0, 115200, "board")
A3: Final = RplidarModel("A3", 0x31, (1, 29), 6, ULTRA, 62.5, 25.0, 10.0, 256000, "board", 3, "Sensitivity")
C1: Final = RplidarModel("C1", 0x41, (1, 1), 18, DENSE, 200.0, 12.0, 10.0, 460800, "built in", 0, "Standard")
S1: Final = RplidarModel("S1", 0x61, (1, 2), 18, DENSE, 108.7, 40.0, 10.0, 256000, "speed", 0, "Standard")
S2: Final = RplidarModel("S2", 0x71, (1, 2), 18, DENSE, 31.25, 30.0, 10.0, 1_000_000, "speed", 1, "DenseBoost")
S3: Final = RplidarModel("S3", 0x81, (1, 2), 18, ULTRA_DENSE, 31.25, 40.0, 10.0, 1_000_000, "speed", 1, "DenseBoost")


class RplidarDevice:
    """State machine: command bytes in, reply bytes out; frames of samples on request.

    fault: it reports protection stop until RESET, `stays_broken`: after it as well. refuses: it starts no stream.
    unanswered: codes of commands that it does not answer.
    """

    def __init__(self, model: RplidarModel = A1) -> None:
        self.model = model
        self.sample_s, self.turns_hz = model.sample_s, model.turns_hz
        # Of the others the stream's directions are those of the samples.
        self.laser_m, self.laser_rad = (_LASER_M, _LASER_RAD) if model.stream == ULTRA else (0.0, 0.0)
        self.streaming = False
        self.fault = self.stays_broken = self.refuses = False
        self.unanswered: frozenset[int] = frozenset()
        self.motor_on = model.motor in {"line", "built in"}
        self.stops = 0
        self._stream = model.stream
        self._line = b""
        self._first = True
        self._held: list[tuple[float, int]] = []

    def power_on(self) -> None:
        """Begin as after power-on."""
        self.streaming, self._line = False, b""
        self.motor_on = self.model.motor in {"line", "built in"}

    def feed(self, chunk: bytes) -> list[bytes]:
        """Process bytes of commands and return the replies."""
        self._line, replies = self._line + chunk, []
        while (begin := self._line.find(b"\xa5")) >= 0 and len(self._line) - begin >= 2:
            self._line = self._line[begin:]
            code, payload, length = self._line[1], b"", 2
            if code & 0x80:
                if len(self._line) < 3 or len(self._line) < (length := 4 + self._line[2]):
                    break
                if reduce(xor, self._line[:length]):
                    self._line = self._line[1:]
                    continue
                payload = self._line[3 : length - 1]
            self._line = self._line[length:]
            if code not in self.unanswered:
                replies += self._answer(code, payload)
        return replies

    def _answer(self, code: int, payload: bytes) -> list[bytes]:
        model = self.model
        match code:
            case 0x25:
                self.streaming, self.stops = False, self.stops + 1
            case 0x40:
                self.power_on()
                self.fault = self.fault and self.stays_broken
                return [b"RP LIDAR System.\r\nFirmware Ver 1.29 - rc9, HW Ver 7\r\n"]
            case 0x50:
                head = bytes([model.code, model.firmware[1], model.firmware[0], model.hardware])
                return [_reply(0x04, head + _SERIAL)]
            case 0x52:
                return [_reply(0x06, struct.pack("<BH", _PROTECTED if self.fault else _GOOD, 4 if self.fault else 0))]
            case 0x59:
                express_us = round(model.sample_us) if not model.configurable else 254
                return [_reply(0x15, struct.pack("<HH", 500, express_us))]
            case 0x84 if model.configurable:
                return self._configuration(*struct.unpack("<I", payload[:4]))
            case 0xF0 | 0xA8:
                self.motor_on = any(payload)
            case 0x20 | 0x21 | 0x82 if not self.fault and not self.refuses:
                self._stream = PLAIN if code != 0x82 else model.stream if payload[0] == model.mode else EXPRESS
                self.streaming, self._first, self._held = True, True, []
                return [_announcement(self._stream)]
            case 0xFF:
                return [_reply(0xFF, struct.pack("<I", model.motor == "board"))]
        return []

    def _configuration(self, key: int) -> list[bytes]:
        model = self.model
        values = {
            0x70: struct.pack("<H", model.mode + 1),
            0x71: struct.pack("<I", round(model.sample_us * 256)),
            0x74: struct.pack("<I", round(model.range_max_m * 256)),
            0x75: bytes([model.stream]),
            0x7C: struct.pack("<H", model.mode),
            0x7F: model.mode_name.encode() + b"\0",
        }
        return [_reply(0x20, struct.pack("<I", key) + values[key])] if key in values else []

    def frames(self, head_deg: Floats, mm: Millimetres) -> list[bytes]:
        """Add samples, directions of the head clockwise and distances (0: none), and return the frames they fill."""
        self._held += zip(head_deg.tolist(), mm.tolist(), strict=True)
        size, found = _SAMPLES[self._stream], []
        beyond = int(self._stream == ULTRA)  # its last word is told relative to the next capsule's first distance
        while len(self._held) >= size + beyond:
            part, self._held = self._held[: size + beyond], self._held[size:]
            found.append(self._frame(part))
            self._first = False
        return found

    def _frame(self, part: list[tuple[float, int]]) -> bytes:
        if self._stream == PLAIN:
            (deg, mm), before = part[0], self._last_deg
            self._last_deg = deg
            return _node(deg, mm, starts=deg < before)
        start = round(part[0][0] * 64) % (360 * 64) | (0x8000 if self._first else 0)
        values = [mm for _, mm in part]
        pairs = zip(values[::2], values[1::2], strict=False)
        if self._stream == EXPRESS:
            return _capsule(struct.pack("<H", start) + b"".join(_cabin(*pair) for pair in pairs))
        if self._stream == ULTRA:
            return _capsule(struct.pack("<H32I", start, *ultra_words(values)))
        if self._stream == ULTRA_DENSE:
            return _capsule(struct.pack("<6xH", start) + b"".join(ultra_dense_cabin(*pair) for pair in pairs))
        return _capsule(struct.pack(f"<H{len(values)}H", start, *values))

    _last_deg: float = 0.0


def _reply(kind: int, payload: bytes) -> bytes:
    return b"\xa5\x5a" + struct.pack("<I", len(payload)) + bytes([kind]) + payload


def _announcement(stream: int) -> bytes:
    return b"\xa5\x5a" + struct.pack("<I", _LENGTHS[stream] | 1 << 30) + bytes([stream])


def _node(deg: float, mm: int, *, starts: bool) -> bytes:
    angle, quality = round(deg * 64) % (360 * 64), 15 if mm else 0
    return bytes([quality << 2 | (1 if starts else 2), (angle & 0x7F) << 1 | 1, angle >> 7]) + struct.pack(
        "<H", min(mm * 4, 0xFFFF)
    )


def _cabin(first_mm: int, second_mm: int) -> bytes:
    return struct.pack("<HHB", min(first_mm * 4, 0xFFFC), min(second_mm * 4, 0xFFFC), 0)


def _capsule(body: bytes) -> bytes:
    total = reduce(xor, body)
    return bytes([0xA0 | total & 15, 0x50 | total >> 4]) + body
