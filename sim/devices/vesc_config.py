"""The application configuration of an emulated VESC: kept, told and taken as by its firmware.

Source: vedderb/bldc `comm/commands.c` (SET_APPCONF), `util/buffer.c` (numbers that are truncated when they are told).
"""

import random
import struct
from typing import Final, Literal

from wallride.drivers.vesc.app_config import LAYOUTS
from wallride.drivers.vesc.codec import Packet
from wallride.sim.devices.vesc_replies import APP_SIGNATURES, Version

UNKNOWN: Final = 1
UNKNOWN_BYTES: Final = 278
CONTROLLER_ID: Final = 74
TOLD_SCALE: Final = 1000.0
"""Of most numbers that are truncated."""
REFUSED_WORDS: Final = b"Warning: Could not set appconf due to wrong signature"
ConfigFault = Literal["", "refused", "mute", "spoiled", "cut before", "cut after"]
"""refused: as with another signature. mute: a controller whose configuration is read-only. spoiled: a byte that was not
asked for changes, too. cut: the cable is pulled at the write, before or after it is stored."""

_HEAD: Final = struct.Struct(">IBIf")
_INT16: Final = struct.Struct(">h")


class EmulatedAppConfig:
    """All bytes without a meaning for a car are arbitrary.

    signature: None for that of the firmware, or one that no driver knows. fault: of the next writes.
    """

    def __init__(self, timeout_s: float, timeout_brake_a: float) -> None:
        self.timeout_s, self.timeout_brake_a = timeout_s, timeout_brake_a
        self.application, self.servo_output = 0, True
        self.signature: int | None = None
        self.fault: ConfigFault = ""
        self._stored: dict[int, bytearray] = {}

    def told(self, version: Version) -> bytes:
        """Return the reply of a firmware to GET_APPCONF."""
        signature = self._signature(version)
        layout = LAYOUTS.get(signature)
        told = bytearray(self._kept(signature))
        _HEAD.pack_into(told, 0, signature, CONTROLLER_ID, round(self.timeout_s * 1000), self.timeout_brake_a)
        if layout is not None:
            told[layout.application] = self.application
            if layout.servo_output is not None:
                told[layout.servo_output] = self.servo_output
            for at in layout.rounded:
                _INT16.pack_into(told, at, _truncated(_INT16.unpack_from(told, at)[0]))
        return bytes((Packet.GET_APPCONF,)) + bytes(told)

    def take(self, version: Version, request: bytes) -> bytes | None:
        """Process SET_APPCONF; return the reply, a printed line where it is refused, None where it says nothing."""
        configuration, signature = request[1:], self._signature(version)
        layout = LAYOUTS.get(signature)
        if self.fault in {"mute", "cut before"}:
            return None
        fits = int.from_bytes(configuration[:4], "big") == signature
        if self.fault == "refused" or layout is None or not fits or len(configuration) < layout.size_bytes:
            return bytes((Packet.PRINT,)) + REFUSED_WORDS
        self._stored[signature] = bytearray(configuration)
        _, _, timeout_ms, self.timeout_brake_a = _HEAD.unpack_from(configuration)
        self.timeout_s, self.application = timeout_ms / 1000, configuration[layout.application]
        if layout.servo_output is not None:
            self.servo_output = bool(configuration[layout.servo_output])
        if self.fault == "spoiled":
            self._stored[signature][-1] ^= 1
        return bytes((Packet.SET_APPCONF,))

    def _signature(self, version: Version) -> int:
        return APP_SIGNATURES.get(version, UNKNOWN) if self.signature is None else self.signature

    def _kept(self, signature: int) -> bytearray:
        layout = LAYOUTS.get(signature)
        size_bytes = layout.size_bytes if layout is not None else UNKNOWN_BYTES
        return self._stored.setdefault(signature, bytearray(random.Random(signature).randbytes(size_bytes)))


def _truncated(number: int) -> int:
    """Return what is told of a number that is kept as a 32-bit float, scaled."""
    kept = struct.unpack("f", struct.pack("f", number / TOLD_SCALE))[0]
    return int(struct.unpack("f", struct.pack("f", kept * TOLD_SCALE))[0])
