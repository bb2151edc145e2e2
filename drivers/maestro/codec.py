"""The Maestro's compact protocol. Pure. Source: Pololu Maestro User's Guide, sections 5.c to 5.e.

84 channel low7 high7    a target, in quarters of a microsecond
90 channel               asks for the position; answered by 2 bytes, little-endian
A1                       asks for the errors, and clears them; answered by 2 bytes, little-endian
"""

from typing import Final

SET_TARGET, GET_POSITION, GET_ERRORS = 0x84, 0x90, 0xA1
ERRORS_OF_ANY_MODE: Final = bytes((0xAA, 0x0C, 0x21))
"""The same question in the Pololu protocol, to device 12: its first byte tells the speed of the line."""
SERIAL_TIMEOUT: Final = 0x0020
KNOWN_ERRORS: Final = 0x01FF
PER_US: Final = 4
ANSWER_BYTES: Final = 4
"""Of `question`: position, errors."""


def set_target(channel: int, pulse_us: float) -> bytes:
    """Return the command for a pulse."""
    target = quarters(pulse_us)
    return bytes((SET_TARGET, channel, target & 0x7F, target >> 7 & 0x7F))


def quarters(pulse_us: float) -> int:
    """Return a pulse in the Maestro's unit."""
    return min(max(round(pulse_us * PER_US), 0), 0x3FFF)


def question(channel: int) -> bytes:
    """Return the question for an output's position and the errors."""
    return bytes((GET_POSITION, channel, GET_ERRORS))


def decode_answer(data: bytes) -> tuple[int, int] | None:
    """Return position and errors; None for bytes that no Maestro answers with."""
    position, errors = int.from_bytes(data[:2], "little"), int.from_bytes(data[2:4], "little")
    return (position, errors) if len(data) == ANSWER_BYTES and not errors & ~KNOWN_ERRORS else None
