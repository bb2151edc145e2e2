"""Replies of an emulated VESC as payload bytes: the inverse of `wallride.drivers.vesc.replies`.

The two share the tables of fields; the golden bytes in the tests verify both.
"""

import struct
from collections.abc import Iterable, Mapping, Sequence

from wallride.drivers.vesc.codec import Packet
from wallride.drivers.vesc.replies import VALUE_FIELDS, VALUE_FIELDS_2X, ValueField

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
