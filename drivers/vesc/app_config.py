"""The VESC's application configuration, as far as a car's safety depends on it. Pure.

Reply to GET_APPCONF: packet id, then a signature of the layout, then its fields. The signature changes with every
change of the layout, so that a known one makes the fields certain, and an unknown one is not read at all. Layouts:
vedderb/bldc `confgenerator.h` and `confgenerator.c` of the tags 3.60 to 5.02 and the branches release_5_03 to
release_7_00. Fields, from the signature on: controller id uint8, timeout uint32 [ms], timeout brake current float [A];
the places of the others differ.
"""

import struct
from dataclasses import dataclass
from typing import Final

from drivers.value import value
from drivers.vesc.codec import Packet

APP_NONE: Final = 0
APPS: Final = {
    0: "none", 1: "PPM", 2: "ADC", 3: "UART", 4: "PPM and UART", 5: "ADC and UART", 6: "nunchuk", 7: "NRF",
    8: "custom", 9: "PAS", 10: "ADC and PAS",
}  # fmt: skip
"""Applications by number (`datatypes.h`, app_use); those with PPM take the pin of the servo output."""
PPM_APPS: Final = frozenset({1, 4})

_HEAD: Final = struct.Struct(">BIBIf")
"""Packet id, signature, controller id, timeout, brake current."""


@dataclass(frozen=True, slots=True)
class AppLayout:
    """Places, counted from the signature. servo_output: None before firmware 5.03, which needs a special build."""

    firmware: str
    application: int
    servo_output: int | None = None


LAYOUTS: Final = {
    543202478: AppLayout("3.60", 22),
    783041200: AppLayout("3.61 to 3.67", 22),
    1232755601: AppLayout("4.02", 22),
    2460147246: AppLayout("5.00 and 5.01", 22),
    3264926020: AppLayout("5.02", 23),
    3733512279: AppLayout("5.03", 29, servo_output=27),
    486554156: AppLayout("6.00 and 6.02", 33, servo_output=31),
    2099347128: AppLayout("6.05 and 6.06", 33, servo_output=31),
    2384027283: AppLayout("7.00", 33, servo_output=31),
}
"""By signature."""


@value()
class AppConfig:
    """timeout_s: 0 is no timeout at all. servo_output: None where the firmware has no such setting."""

    timeout_s: float
    timeout_brake_a: float
    application: int
    servo_output: bool | None


def decode_app_config(payload: bytes) -> AppConfig | None:
    """Read a reply to GET_APPCONF; None where its layout is not known, or it is too short."""
    if len(payload) < _HEAD.size or payload[0] != Packet.GET_APPCONF:
        return None
    _, signature, _, timeout_ms, brake_a = _HEAD.unpack_from(payload)
    layout = LAYOUTS.get(signature)
    if layout is None or len(payload) <= 1 + max(layout.application, layout.servo_output or 0):
        return None
    servo = None if layout.servo_output is None else bool(payload[1 + layout.servo_output])
    return AppConfig(timeout_ms / 1000, brake_a, payload[1 + layout.application], servo)
