"""What RPLIDAR models differ in: name, motor, and whether they tell their configuration."""

from enum import StrEnum
from typing import Final

from wallride.drivers.turning.replies import SensorInfo

_NAMES: Final = {
    0x18: "A1M8", 0x28: "A2M8", 0x27: "A2M7", 0x2C: "A2M12", 0x31: "A3M1", 0x41: "C1", 0x61: "S1", 0x71: "S2",
    0x81: "S3", 0x82: "S3",
}  # fmt: skip
_A_SERIES: Final = 3
"""Highest series number of those that are named A."""
_BUILT_IN: Final = 4
_CONFIGURABLE_FIRMWARE, _EXPRESS_FIRMWARE = (1, 24), (1, 17)
RANGE_MIN_M: Final = 0.15
RANGE_MAX_M: Final = 12.0
"""Of a sensor that does not tell it: the A1's, the shortest."""


class HeadDrive(StrEnum):
    """How the head is made to turn."""

    LINE = "line"
    """By the line DTR: cleared, it turns."""
    BOARD = "board"
    """By the duty that the accessory board gets, or by DTR where there is no such board."""
    SPEED = "speed"
    """By a speed command."""
    BUILT_IN = "built in"
    """It turns while it measures."""


def name_of(info: SensorInfo) -> str:
    """Return the model's name."""
    return f"RPLIDAR {_NAMES.get(info.model, f'model {info.model:#04x}')}"


def motor_of(info: SensorInfo) -> HeadDrive:
    """Return how the model's head is made to turn."""
    series = info.model >> 4
    if series == 1:
        return HeadDrive.LINE
    if series <= _A_SERIES:
        return HeadDrive.BOARD
    return HeadDrive.BUILT_IN if series == _BUILT_IN else HeadDrive.SPEED


def tells_configuration(info: SensorInfo) -> bool:
    """Return whether it answers questions about its modes."""
    return info.model >> 4 > _A_SERIES or info.firmware >= _CONFIGURABLE_FIRMWARE


def has_express(info: SensorInfo) -> bool:
    """Return whether it has the oldest compressed stream."""
    return info.firmware >= _EXPRESS_FIRMWARE
