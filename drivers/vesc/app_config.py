"""The VESC's application configuration, as far as a car's safety depends on it: read it, and change it. Pure.

Reply to GET_APPCONF and request SET_APPCONF: packet id, then the configuration: signature uint32, controller id uint8,
timeout uint32 [ms], timeout brake current float [A], and what differs. The signature changes with every change of the
layout; a configuration is changed only where its layout is known to the last byte: signature and length. Source:
vedderb/bldc `confgenerator.h` and `confgenerator.c` of the tags 3.60 to 5.02 and the branches release_5_03 to
release_7_00.
"""

import struct
from dataclasses import dataclass
from typing import Final

from wallride.drivers.value import value

APPS: Final = {
    0: "none", 1: "PPM", 2: "ADC", 3: "UART", 4: "PPM and UART", 5: "ADC and UART", 6: "nunchuk", 7: "NRF",
    8: "custom", 9: "PAS", 10: "ADC and PAS",
}  # fmt: skip
"""Applications by number (`datatypes.h`, app_use); those with PPM take the pin of the servo output."""
PPM_APPS: Final = frozenset({1, 4})
RECOMMENDED_TIMEOUT_S: Final = 0.15
RECOMMENDED_BRAKE_A: Final = 10.0
"""Command timeout, and the brake current after it, of a car that is set up (docs/bring-up.md)."""

_HEAD: Final = struct.Struct(">IBIf")
"""Signature, controller id, timeout, brake current."""
_TIMEOUT: Final = struct.Struct(">If")
_TIMEOUT_AT: Final = 5
_INT16: Final = struct.Struct(">h")


@dataclass(frozen=True, slots=True)
class AppLayout:
    """Places in bytes, counted from the signature.

    servo_output: None before firmware 5.03, which needs a special build. rounded: places of the 16-bit numbers which
    the firmware keeps as floats and truncates when it tells them, so that they can lose one unit by being written.
    """

    firmware: str
    size_bytes: int
    application: int
    servo_output: int | None = None
    rounded: tuple[int, ...] = ()


_BALANCE_5_03: Final = (245, 247, 249, 251, 253, 259, 261, 267)
_ADC_6: Final = (80, 95, 97, 99, 101, 103, 105, 107)

LAYOUTS: Final = {
    543202478: AppLayout("3.60", 256, 22),
    583966563: AppLayout("3.61 and 3.62", 264, 22),
    783041200: AppLayout("3.63 to 3.67", 331, 22),
    1232755601: AppLayout("4.02", 367, 22),
    2460147246: AppLayout("5.00 and 5.01", 389, 22),
    3264926020: AppLayout("5.02", 418, 23, rounded=(330, 332, 334, 340, 342)),
    3733512279: AppLayout("5.03", 476, 29, 27, (76, *_BALANCE_5_03, 283, 404, 406, 408, 414, 416)),
    486554156: AppLayout(
        "6.00 and 6.02", 493, 33, 31,
        (*_ADC_6, 256, 258, 260, 262, 264, 270, 272, 278, 294, 411, 413, 415, 421, 423, 430, 432, 434, 436),
    ),
    2099347128: AppLayout("6.05 and 6.06", 278, 33, 31, (*_ADC_6, 196, 198, 200, 206, 208, 215, 217, 219, 221)),
    2384027283: AppLayout("7.00", 284, 33, 31, (*_ADC_6, 184, 202, 204, 206, 212, 214, 221, 223, 225, 227)),
}  # fmt: skip
"""By signature."""


@value()
class AppConfig:
    """timeout_s: 0 is no timeout at all. servo_output: None where the firmware has no such setting."""

    timeout_s: float
    timeout_brake_a: float
    application: int
    servo_output: bool | None


def decode_app_config(configuration: bytes) -> AppConfig | None:
    """Read a configuration, from the signature on; None where its layout is not known, or it is too short."""
    if len(configuration) < _HEAD.size:
        return None
    signature, _, timeout_ms, brake_a = _HEAD.unpack_from(configuration)
    layout = LAYOUTS.get(signature)
    if layout is None or len(configuration) <= max(layout.application, layout.servo_output or 0):
        return None
    servo = None if layout.servo_output is None else bool(configuration[layout.servo_output])
    return AppConfig(timeout_ms / 1000, brake_a, configuration[layout.application], servo)


def layout_of(configuration: bytes) -> AppLayout | None:
    """Return the layout of a configuration (from its signature on) that is known to the last byte, else None."""
    layout = LAYOUTS.get(int.from_bytes(configuration[:4], "big"))
    return layout if layout is not None and len(configuration) == layout.size_bytes else None


def change_app_config(
    configuration: bytes, *, timeout_s: float, timeout_brake_a: float, servo_output: bool | None
) -> bytes:
    """Return a configuration with other values; servo_output: None leaves it.

    ValueError: the layout is not known to the last byte, or the firmware has no servo output to set.
    """
    layout = layout_of(configuration)
    if layout is None or (servo_output is not None and layout.servo_output is None):
        raise ValueError("this configuration cannot be changed so")
    changed = bytearray(configuration)
    _TIMEOUT.pack_into(changed, _TIMEOUT_AT, round(timeout_s * 1000), timeout_brake_a)
    if servo_output is not None and layout.servo_output is not None:
        changed[layout.servo_output] = servo_output
    return bytes(changed)


def unlike_places(written: bytes, found: bytes) -> list[int]:
    """Return the places at which a configuration is not as written, but for the firmware's own rounding.

    A number that the firmware keeps as a float may be one unit nearer to 0 than it was written.
    """
    layout = layout_of(written)
    if layout is None or len(found) != len(written):
        return list(range(max(len(written), len(found))))
    forgiven = {
        place
        for at in layout.rounded
        if _is_rounded(_INT16.unpack_from(written, at)[0], _INT16.unpack_from(found, at)[0])
        for place in (at, at + 1)
    }
    return [place for place in range(len(written)) if written[place] != found[place] and place not in forgiven]


def _is_rounded(written: int, found: int) -> bool:
    return written != 0 and found == written - (1 if written > 0 else -1)
