"""Decoding of the VESC's replies, from payload bytes to values; the counterpart of `codec`, equally pure.

Replies grow with the firmware: every decoder takes what it knows, ignores what follows and returns None for a payload
too short to be of use. Match replies by their first byte, never by order: text (PRINT) arrives in between. Layouts:
vedderb/bldc `comm/commands.c`, tags 2.18 to 6.05.
"""

import math
import struct
from dataclasses import dataclass
from typing import Any, NamedTuple

from wallride.drivers.api import printable
from wallride.drivers.value import value

STATUS_TIMED_OUT = 1
STATUS_KILLED = 2
HARDWARE_VESC = 0
HARDWARE_KINDS = {HARDWARE_VESC: "VESC", 1: "battery manager", 2: "custom module"}

_UUID_BYTES = 12
_HARDWARE_KIND_BYTE = 14
"""Its place behind the name of the hardware: after the UUID and two flags."""
STANDARD_GRAVITY_MPS2 = 9.80665


@value()
class Firmware:
    """Reply to FW_VERSION, as far as a car reads it.

    uuid: of the controller, 12 bytes; none where not sent. hardware_kind: key of HARDWARE_KINDS, None where not sent.
    """

    major: int
    minor: int
    hardware: str = ""
    uuid: bytes = b""
    hardware_kind: int | None = None

    @property
    def version(self) -> str:
        """The version in VESC Tool's form: 6.05, 3.40."""
        return f"{self.major}.{self.minor:02d}"


def decode_firmware(payload: bytes) -> Firmware | None:
    """Read as much of a FW_VERSION reply as there is; None without a version."""
    if len(payload) < 3:
        return None
    hardware, _, rest = payload[3:].partition(b"\0")
    kind = rest[_HARDWARE_KIND_BYTE] if len(rest) > _HARDWARE_KIND_BYTE else None
    uuid = rest[:_UUID_BYTES] if len(rest) >= _UUID_BYTES else b""
    return Firmware(payload[1], payload[2], printable(hardware), uuid, kind)


@dataclass(slots=True)  # never changed; frozen would double the time to make one, fifty times a second
class Values:
    """Reply to GET_VALUES; values that a firmware does not report are NaN or None.

    erpm and currents: positive drives forward. tachometer: int32, 6 steps per electrical turn, wraps. "Mean" currents
    are means since the last request of any client: VESC Tool in parallel changes them.
    status: bit 0 command timeout active, bit 1 kill switch active; firmware 5.03 and later.
    """

    motor_current_a: float
    input_current_a: float
    duty: float
    erpm: int
    voltage_v: float
    drawn_ah: float
    charged_ah: float
    drawn_wh: float
    charged_wh: float
    tachometer: int
    tachometer_abs: int
    fault_code: int
    mosfet_temperature_c: float = math.nan
    motor_temperature_c: float = math.nan
    direct_current_a: float = math.nan
    quadrature_current_a: float = math.nan
    position_deg: float | None = None
    controller_id: int | None = None
    mosfet_temperatures_c: tuple[float, ...] | None = None
    direct_voltage_v: float | None = None
    quadrature_voltage_v: float | None = None
    status: int | None = None
    board_temperature_c: float | None = None


class ValueField(NamedTuple):
    """One field on the wire: struct format without byte order, units per SI unit (0: an integer as it is)."""

    name: str
    layout: str
    scale: int


VALUE_FIELDS = (
    ValueField("mosfet_temperature_c", "h", 10),
    ValueField("motor_temperature_c", "h", 10),
    ValueField("motor_current_a", "i", 100),
    ValueField("input_current_a", "i", 100),
    ValueField("direct_current_a", "i", 100),
    ValueField("quadrature_current_a", "i", 100),
    ValueField("duty", "h", 1000),
    ValueField("erpm", "i", 0),
    ValueField("voltage_v", "h", 10),
    ValueField("drawn_ah", "i", 10_000),
    ValueField("charged_ah", "i", 10_000),
    ValueField("drawn_wh", "i", 10_000),
    ValueField("charged_wh", "i", 10_000),
    ValueField("tachometer", "i", 0),
    ValueField("tachometer_abs", "i", 0),
    ValueField("fault_code", "B", 0),
    ValueField("position_deg", "i", 1_000_000),
    ValueField("controller_id", "B", 0),
    ValueField("mosfet_temperatures_c", "hhh", 10),
    ValueField("direct_voltage_v", "i", 1000),
    ValueField("quadrature_voltage_v", "i", 1000),
    ValueField("status", "B", 0),
)
"""Firmware 3.x and later, in the order of the wire; the index is the bit in a selective mask."""

VALUE_FIELDS_2X = (
    ValueField("mosfet_temperatures_c", "hhhhhh", 10),
    ValueField("board_temperature_c", "h", 10),
    *(field for field in VALUE_FIELDS[2:16] if field.name not in {"direct_current_a", "quadrature_current_a"}),
)
"""Firmware 2.x: other temperatures, no currents by axis, nothing after the fault code."""

_NEEDED = VALUE_FIELDS[:16]


class _FieldReader:
    """Reads fields until they or the bytes run out.

    The plan for a length is cached, because the length rarely changes.
    """

    def __init__(self, wanted: tuple[ValueField, ...]) -> None:
        self._wanted = wanted
        self._plans: dict[int, tuple[struct.Struct, tuple[tuple[str, int, int, int], ...]]] = {}

    def read(self, payload: bytes, offset: int) -> dict[str, Any]:
        """Return values by name; those beyond the end of the bytes are missing."""
        size_bytes = max(0, len(payload) - offset)
        plan = self._plans.get(size_bytes)
        if plan is None:
            plan = self._plans[size_bytes] = self._plan(size_bytes)
        layout, places = plan
        numbers = layout.unpack_from(payload, offset) if places else ()
        fields: dict[str, Any] = {}
        for name, first, count, scale in places:
            if count == 1:
                fields[name] = numbers[first] / scale if scale else numbers[first]
            else:
                fields[name] = tuple(number / scale for number in numbers[first : first + count])
        return fields

    def _plan(self, size_bytes: int) -> tuple[struct.Struct, tuple[tuple[str, int, int, int], ...]]:
        formats, places, first = ">", [], 0
        for name, layout, scale in self._wanted:
            if struct.calcsize(formats + layout) > size_bytes:
                break
            formats += layout
            places.append((name, first, len(layout), scale))
            first += len(layout)
        return struct.Struct(formats), tuple(places)


_VALUES = _FieldReader(VALUE_FIELDS)
_VALUES_2X = _FieldReader(VALUE_FIELDS_2X)


def decode_values(payload: bytes) -> Values | None:
    """Read a GET_VALUES reply of firmware 3.x and later; None when it ends before the fault code."""
    fields = _VALUES.read(payload, 1)
    return Values(**fields) if len(fields) >= len(_NEEDED) else None


def decode_values_2x(payload: bytes) -> Values | None:
    """Read a GET_VALUES reply of firmware 2.x, whose hottest MOSFET becomes the temperature."""
    fields = _VALUES_2X.read(payload, 1)
    if len(fields) < len(VALUE_FIELDS_2X):
        return None
    return Values(**fields, mosfet_temperature_c=max(fields["mosfet_temperatures_c"]))


@value()
class Imu:
    """Reply to GET_IMU_DATA, as far as a car reads it, in the VESC's own axes; NaN where it was not requested.

    A VESC without an IMU answers too, all zeros: acceleration under 2 m/s2 for a second means there is none.
    """

    acceleration_mps2: tuple[float, ...]
    rate_radps: tuple[float, ...]


def decode_imu(payload: bytes) -> Imu | None:
    """Read a GET_IMU_DATA reply; None when it is shorter than its own mask states."""
    if len(payload) < 3:
        return None
    mask = int.from_bytes(payload[1:3], "big")
    end = 3 + 4 * mask.bit_count()
    if len(payload) < end:
        return None
    sent = iter(struct.unpack(f">{mask.bit_count()}f", payload[3:end]))
    all16 = [next(sent) if mask >> bit & 1 else math.nan for bit in range(16)]
    return Imu(
        acceleration_mps2=tuple(value * STANDARD_GRAVITY_MPS2 for value in all16[3:6]),
        rate_radps=tuple(math.radians(value) for value in all16[6:9]),
    )
