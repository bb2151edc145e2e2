"""Replies of an emulated VESC as payload bytes: the inverse of `wallride.drivers.vesc.replies`.

The two share the tables of fields; the golden bytes in the tests verify both. The application configuration is kept,
told and taken as by the firmware; source: vedderb/bldc `comm/commands.c` (SET_APPCONF), `util/buffer.c` (numbers that
are truncated when they are told).
"""

import random
import struct
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, Literal

from wallride.drivers.vesc.app_config import LAYOUTS
from wallride.drivers.vesc.codec import Packet
from wallride.drivers.vesc.replies import VALUE_FIELDS, VALUE_FIELDS_2X, ValueField

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
Version = tuple[int, int]
Value = float | Sequence[float]


APP_SIGNATURES = {
    (3, 60): 543202478,
    (3, 62): 583966563,
    (4, 2): 1232755601,
    (5, 2): 3264926020,
    (5, 3): 3733512279,
    (6, 0): 486554156,
    (6, 2): 486554156,
    (6, 5): 2099347128,
    (6, 6): 2099347128,
    (7, 0): 2384027283,
}
"""Of the application configuration, by firmware; others have a layout that no driver knows."""

UUID = bytes.fromhex("34002c000e51393035343031")
HARDWARE_CRC = 0x1A2B3C4D
_UNKNOWN_BYTE = b"\0"


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


def firmware_reply(version: Version, hardware: str = "60", kind: int = 0) -> bytes:
    """Return the FW_VERSION reply of this firmware; each generation reports more fields.

    Bare before 3.0; then name and UUID; pairing 4.02; test version 5.00; kind and four more 5.03; NRF flags and
    firmware name 6.0; hardware CRC 6.05.
    """
    payload = bytes((Packet.FW_VERSION, *version))
    if version < (3, 0):
        return payload
    payload += hardware.encode("ascii") + b"\0" + UUID
    additions = (
        ((4, 2), _UNKNOWN_BYTE),
        ((5, 0), _UNKNOWN_BYTE),
        ((5, 3), bytes((kind, 0, 0, 0, 0))),
        ((6, 0), b"\0" + b"\0"),
        ((6, 5), HARDWARE_CRC.to_bytes(4, "big")),
    )
    return payload + b"".join(added for since, added in additions if version >= since)


def values_reply(version: Version, values: Mapping[str, Value]) -> bytes:
    """Return the GET_VALUES reply of this firmware: 56, 59, 73 or 74 bytes. Missing values are 0."""
    if version < (3, 0):
        return bytes((Packet.GET_VALUES,)) + _fields(VALUE_FIELDS_2X, values)
    count = 18 if version < (4, 2) else 21 if version < (5, 3) else len(VALUE_FIELDS)
    return bytes((Packet.GET_VALUES,)) + _fields(VALUE_FIELDS[:count], values)


def selective_reply(request: bytes, values: Mapping[str, Value]) -> bytes:
    """Return the GET_VALUES_SELECTIVE reply to this request."""
    mask = int.from_bytes(request[1:5], "big")
    return request[:5] + _fields((field for bit, field in enumerate(VALUE_FIELDS) if mask >> bit & 1), values)


def imu_reply(version: Version, request: bytes, imu: Sequence[float], controller_id: int) -> bytes:
    """Return the GET_IMU_DATA reply; imu: 16 numbers in the wire's units (rad, g, deg/s, uT, quaternion w x y z)."""
    mask = int.from_bytes(request[1:3], "big")
    sent = [number for bit, number in enumerate(imu) if mask >> bit & 1]
    payload = request[:3] + struct.pack(f">{len(sent)}f", *sent)
    return payload if version < (5, 3) else payload + bytes((controller_id,))


def _fields(fields: Iterable[ValueField], values: Mapping[str, Value]) -> bytes:
    return b"".join(_field(field, values.get(field.name, 0)) for field in fields)


def _field(field: ValueField, value: Value) -> bytes:
    numbers = value if isinstance(value, Sequence) else (value,) * len(field.layout)
    return struct.pack(">" + field.layout, *(_on_wire(number, field) for number in numbers))


def _on_wire(number: float, field: ValueField) -> int:
    """Scale, and wrap values that are too large: only counters reach that."""
    raw = round(number * (field.scale or 1))
    bits = 8 * struct.calcsize(">" + field.layout[0])
    if field.layout[0].isupper():
        return raw % (1 << bits)
    return (raw + (1 << bits - 1)) % (1 << bits) - (1 << bits - 1)
