"""Meaning of a Hokuyo's replies: its parameters (PP), version (VV), state (II) and status codes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final, Self

from wallride.drivers.api import ProtocolError, printable
from wallride.drivers.hokuyo.codec import ReplyBlock
from wallride.drivers.scan_check import too_slow, unfit

MAX_RANGE_MM: Final = 262143
"""Maximum value of three characters."""
_MAX_STEP: Final = 9999  # four digits in a command
_COARSEST_DEG: Final = 1.0


def decode_number(text: bytes) -> int | None:
    """Return the value of two to four characters, six bits each, most significant first; None if one is no digit."""
    value = 0
    for character in text:
        if not 0x30 <= character <= 0x6F:
            return None
        value = value << 6 | (character - 0x30)
    return value


def fields(block: ReplyBlock) -> dict[str, str]:
    """Return the KEY:VALUE lines of PP, VV or II, printable; lines without a colon are left out."""
    pairs = (printable(line).partition(":") for line in block.lines)
    return {key.strip(): value.strip() for key, colon, value in pairs if colon}


@dataclass(frozen=True, slots=True)
class SensorParameters:
    """The sensor's parameters from PP.

    Step k points to (k - front_step) * 2 pi / steps_per_turn, counter-clockwise positive.
    """

    model: str
    range_min_mm: int
    range_max_mm: int
    steps_per_turn: int
    first_step: int
    last_step: int
    front_step: int
    speed_rpm: int

    @classmethod
    def from_fields(cls, values: Mapping[str, str]) -> Self:
        """Read a PP reply; ProtocolError names the key that is missing or invalid."""
        parameters = cls(
            model=values.get("MODL", "").partition("(")[0].strip() or "unnamed Hokuyo",
            range_min_mm=_number(values, "DMIN", 0, MAX_RANGE_MM),
            range_max_mm=_number(values, "DMAX", 1, MAX_RANGE_MM),
            steps_per_turn=_number(values, "ARES", 1, 36000),
            first_step=_number(values, "AMIN", 0, _MAX_STEP),
            last_step=_number(values, "AMAX", 0, _MAX_STEP),
            front_step=_number(values, "AFRT", 0, _MAX_STEP),
            speed_rpm=_number(values, "SCAN", 1, 60000),
        )
        if parameters.range_min_mm >= parameters.range_max_mm:
            raise ProtocolError(f"the sensor's PP reply has DMIN {values['DMIN']} not below DMAX {values['DMAX']}")
        if not 0 < parameters.last_step - parameters.first_step < parameters.steps_per_turn:
            raise ProtocolError(f"the sensor's PP reply has a field from step {values['AMIN']} to {values['AMAX']}")
        return parameters

    @property
    def beam_count(self) -> int:
        """Number of samples in a full scan."""
        return self.last_step - self.first_step + 1

    @property
    def rate_hz(self) -> float:
        """Scans per second."""
        return self.speed_rpm / 60

    @property
    def angle_step_rad(self) -> float:
        """Angle between neighbouring beams."""
        return 2 * math.pi / self.steps_per_turn

    @property
    def unfit(self) -> str:
        """Reason why the sensor is unfit for driving, "" where it is fit."""
        edges_rad = self.angle_rad(self.first_step), self.angle_rad(self.last_step)
        view = unfit(*edges_rad, self.angle_step_rad, self.range_min_mm / 1000, _COARSEST_DEG)
        return view or too_slow(self.rate_hz)

    def angle_rad(self, step: int) -> float:
        """Return the direction of a step, 0 = front, left positive, for a sensor mounted upright."""
        return (step - self.front_step) * self.angle_step_rad


def _number(values: Mapping[str, str], key: str, least: int, most: int) -> int:
    text = values.get(key)
    if text is None:
        raise ProtocolError(f"the sensor's PP reply lacks {key} (no SCIP 2.x sensor, or a damaged reply)")
    if not (text.isascii() and text.isdecimal() and len(text) <= 9 and least <= int(text) <= most):
        raise ProtocolError(f"the sensor's PP reply has {key}:{text[:20]!r}, not a number from {least} to {most}")
    return int(text)


_HEALTHY_STATES: Final = ("sensor works well", "no error", "sensor is working normally")


def is_healthy(state_text: str) -> bool:
    """Judge the STAT line of II; three product families report a good state in three ways."""
    return any(healthy in state_text.lower() for healthy in _HEALTHY_STATES)


class StreamStatus(Enum):
    """The driver's reaction to a status code in a scan stream."""

    ACCEPTED = "accepted"
    SCAN = "scan data follows"
    RESUMED = "measuring again after a self-check"
    UNSTABLE = "no data this time; the sensor checks itself"
    ABNORMAL = "the sensor is in trouble; reset it"
    REFUSED = "the command was refused"


_STREAM_STATUS: Final = {
    "00": StreamStatus.ACCEPTED,
    "99": StreamStatus.SCAN,
    "98": StreamStatus.RESUMED,
    "0M": StreamStatus.UNSTABLE,
    "0L": StreamStatus.ABNORMAL,
}


def judge(status: str) -> StreamStatus:
    """Classify a status of MD, MS or ME (C-42-03320B; the SCIP 2.2 letters by hokuyolx)."""
    if status in _STREAM_STATUS:
        return _STREAM_STATUS[status]
    if status.isdecimal() and 21 <= int(status) <= 49:
        return StreamStatus.UNSTABLE
    if status.isdecimal() and 50 <= int(status) <= 97:
        return StreamStatus.ABNORMAL
    return StreamStatus.REFUSED
