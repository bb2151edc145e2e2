"""RPLIDAR on the wire: commands out, identity and plain samples in. No port, no clock, no log.

    command   A5 code [length payload xor]
    sample    quality and start bits, angle (15 bits, 1/64 degree) and check bit, distance (1/4 mm): 5 bytes

Source: Slamtec protocol v2.8 and its SDK. Numbers are little-endian.
"""

from functools import reduce
from operator import xor
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.drivers.turning.samples import NO_SAMPLES, Count, HeadSamples, joined, lost_samples, metres

STOP, RESET, SCAN, GET_INFO, GET_HEALTH = 0x25, 0x40, 0x20, 0x50, 0x52
GET_SAMPLE_TIME, EXPRESS_SCAN, GET_CONFIGURATION = 0x59, 0x82, 0x84
SET_SPEED, SET_PWM, GET_MOTOR_BOARD = 0xA8, 0xF0, 0xFF
"""Codes of the commands in use."""
INFO, HEALTH, SAMPLE_TIME, CONFIGURATION, MOTOR_BOARD = 0x04, 0x06, 0x15, 0x20, 0xFF
"""Types of the replies."""
US_PER_SAMPLE, MAX_DISTANCE, ANSWER, TYPICAL_MODE, MODE_NAME = 0x71, 0x74, 0x75, 0x7C, 0x7F
"""Keys of the configuration."""
PLAIN: Final = 0x81
NODE_BYTES: Final = 5
_HAS_PAYLOAD: Final = 0x80


def command(code: int, payload: bytes = b"") -> bytes:
    """Return the bytes of a command; one with a payload ends with the exclusive or of all bytes before."""
    if not code & _HAS_PAYLOAD:
        return bytes([0xA5, code])
    body = bytes([0xA5, code, len(payload)]) + payload
    return body + bytes([reduce(xor, body)])


def express_scan(mode: int) -> bytes:
    """Return the command that starts the stream of a mode."""
    return command(EXPRESS_SCAN, bytes([mode, 0, 0, 0, 0]))


def set_pwm(duty: int) -> bytes:
    """Return the command for the motor of the accessory board; duty of 1023."""
    return command(SET_PWM, duty.to_bytes(2, "little"))


def set_speed(rpm: int) -> bytes:
    """Return the command for the motor of the S series."""
    return command(SET_SPEED, rpm.to_bytes(2, "little"))


def ask_configuration(key: int, mode: int | None = None) -> bytes:
    """Return the request for an entry of the configuration, of one mode where it has one for each."""
    payload = key.to_bytes(4, "little")
    return command(GET_CONFIGURATION, payload if mode is None else payload + mode.to_bytes(2, "little"))


def decode_sample_times_us(payload: bytes) -> tuple[int, int] | None:
    """Return the time of a plain sample and of one in an express capsule."""
    if len(payload) != 4:
        return None
    return int.from_bytes(payload[:2], "little"), int.from_bytes(payload[2:], "little")


def decode_configuration(payload: bytes, key: int) -> bytes | None:
    """Return the value of an entry, None for the reply to another request."""
    return payload[4:] if len(payload) > 4 and int.from_bytes(payload[:4], "little") == key else None


class PlainDecoder:
    """Decodes the plain stream. There is no checksum: a sample is recognised by three bits.

    Counts "resync" when bytes were skipped.
    """

    behind = 0
    """Number of samples that wait for later bytes."""

    def __init__(self, count: Count) -> None:
        self._count = count
        self._rest = b""

    def feed(self, chunk: bytes) -> HeadSamples:
        """Add bytes and return the samples that they completed."""
        raw = np.frombuffer(self._rest + chunk, np.uint8)
        if raw.size < NODE_BYTES:
            self._rest = raw.tobytes()
            return NO_SAMPLES
        fits = ((raw[:-1] ^ (raw[:-1] >> 1)) & raw[1:] & 1).astype(np.bool_)  # start bits differ, check bit is set
        parts, at, lost_bytes = [], 0, 0
        while raw.size - at >= NODE_BYTES:
            row = fits[at : raw.size - NODE_BYTES + 1 : NODE_BYTES]
            good = row.size if row.all() else int(row.argmin())
            if good:
                parts.append(_plain_samples(raw[at : at + good * NODE_BYTES]))
                at += good * NODE_BYTES
            else:
                at, lost_bytes = at + 1, lost_bytes + 1
        self._rest = raw[at:].tobytes()
        if not lost_bytes:
            return joined(parts)
        self._count("resync")
        return joined([*parts, lost_samples(-(-lost_bytes // NODE_BYTES))])


def _plain_samples(raw: npt.NDArray[np.uint8]) -> HeadSamples:
    rows = raw.reshape(-1, NODE_BYTES).astype(np.float64)
    deg = (np.floor(rows[:, 1] / 2) + rows[:, 2] * 128) / 64 % 360.0
    return HeadSamples(deg, deg, metres((rows[:, 3] + rows[:, 4] * 256) / 4))
