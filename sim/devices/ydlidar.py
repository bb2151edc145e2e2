"""State machine of a YDLIDAR and the encoding of its packets; deliberately not built on the driver's codec."""

import math
import struct
from dataclasses import dataclass
from functools import reduce
from operator import xor
from typing import Final

import numpy as np
import numpy.typing as npt

Millimetres = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

_PACKET_SAMPLES: Final = 40
_LASER_M, _MEETS_M = 0.0218, 0.1553
"""The laser begins so far beside the receiver, and meets its axis so far ahead."""
_DIGITS: Final = bytes([2, 0, 1, 8, 0, 7, 2, 6, 0, 0, 0, 0, 0, 1, 0, 9])


@dataclass(frozen=True, slots=True)
class YdlidarModel:
    """Identity and stream of one model. divisor: steps of a sample per millimetre."""

    name: str
    code: int
    sample_s: float
    turns_hz: float
    baud: int
    divisor: int = 4
    triangulates: bool = True
    one_way: bool = False


X4: Final = YdlidarModel("X4", 6, 1 / 5000, 7.0, 128000)
X2: Final = YdlidarModel("X2", 0, 1 / 3000, 6.0, 115200, one_way=True)
X4_PRO: Final = YdlidarModel("X4-Pro", 0, 1 / 5000, 7.0, 128000, one_way=True)
G4: Final = YdlidarModel("G4", 5, 1 / 9000, 9.0, 230400)
G6: Final = YdlidarModel("G6", 13, 1 / 18000, 10.0, 512000, divisor=2, triangulates=False)
TG: Final = YdlidarModel("TG", 100, 1 / 20000, 10.0, 512000, divisor=1, triangulates=False)


class YdlidarDevice:
    """State machine: command bytes in, reply bytes out; packets of samples on request.

    fault: it reports an error until a reset, `stays_broken`: after it as well. refuses: it starts no stream.
    unanswered: codes of commands that it does not answer.
    """

    def __init__(self, model: YdlidarModel = X4) -> None:
        self.model = model
        self.sample_s, self.turns_hz = model.sample_s, model.turns_hz
        self.laser_m = _LASER_M if model.triangulates else 0.0
        self.laser_rad = math.atan(_LASER_M / _MEETS_M) if model.triangulates else 0.0
        self.streaming = model.one_way
        self.fault = self.stays_broken = self.refuses = False
        self.unanswered: frozenset[int] = frozenset()
        self.motor_on = True
        self.stops = 0
        self._line = b""
        self._held: list[tuple[float, int]] = []
        self._last_deg = 0.0

    def power_on(self) -> None:
        """Begin as after power-on."""
        self.streaming, self._line, self._held = self.model.one_way, b"", []

    def feed(self, chunk: bytes) -> list[bytes]:
        """Process bytes of commands and return the replies."""
        if self.model.one_way:
            return []
        self._line, replies = self._line + chunk, []
        while (begin := self._line.find(b"\xa5")) >= 0 and len(self._line) - begin >= 2:
            code, self._line = self._line[begin + 1], self._line[begin + 2 :]
            if code not in self.unanswered:
                replies += self._answer(code)
        return replies

    def _answer(self, code: int) -> list[bytes]:
        match code:
            case 0x65 | 0x00:
                self.streaming, self.stops = False, self.stops + 1
            case 0x90:
                return [_reply(0x04, bytes([self.model.code, 5, 1, 1]) + _DIGITS)]
            case 0x91 | 0x92:  # both are in manuals, and PyLidar3 asks the older one
                return [_reply(0x06, struct.pack("<BH", 2 if self.fault else 0, 8 if self.fault else 0))]
            case 0x40 | 0x80:
                self.power_on()
                self.fault = self.fault and self.stays_broken
            case 0x60 | 0x61 if not self.refuses:
                self.streaming, self._held = True, []
                return [b"\xa5\x5a\x05\x00\x00\x40\x81"]
        return []

    def frames(self, head_deg: Floats, mm: Millimetres) -> list[bytes]:
        """Add samples, directions of the head clockwise and distances (0: none), and return the packets they fill."""
        found = []
        for deg, distance_mm in zip(head_deg.tolist(), mm.tolist(), strict=True):
            if deg < self._last_deg:
                if self._held:
                    found.append(self._packet(self._held))
                    self._held = []
                found.append(self._packet([(deg, 0)], starts=True))
            self._last_deg = deg
            self._held.append((deg, distance_mm))
            if len(self._held) == _PACKET_SAMPLES:
                found.append(self._packet(self._held))
                self._held = []
        return found

    def _packet(self, part: list[tuple[float, int]], *, starts: bool = False) -> bytes:
        kind = round(self.model.turns_hz * 10) << 1 | 1 if starts else 0
        ends = [round(deg * 64) % (360 * 64) << 1 | 1 for deg in (part[0][0], part[-1][0])]
        sizes = [mm * self.model.divisor for _, mm in part]
        samples = [size if size <= 0xFFFF else 0 for size in sizes]
        words = [0x55AA, kind | len(part) << 8, *ends]
        return struct.pack(f"<5H{len(samples)}H", *words, reduce(xor, words + samples), *samples)


def _reply(kind: int, payload: bytes) -> bytes:
    return b"\xa5\x5a" + struct.pack("<I", len(payload)) + bytes([kind]) + payload
