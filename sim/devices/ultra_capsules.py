"""Contents of the capsules of RPLIDAR A3 (ultra) and S3 (ultra dense), encoded; not built on the driver's decoder.

Source: Slamtec SDK, `handler_capsules.cpp`, described in the protocol v2.8.
"""

import struct
from collections.abc import Sequence
from typing import Final

_SCALES: Final = ((16384, 3328, 4), (4096, 1792, 3), (2048, 1280, 2), (512, 512, 1), (0, 0, 0))
"""From which distance [mm] on, the value of 12 bits where it begins, and the power of two of a step."""
_FAR_MM: Final = 16384 + ((0xFFF - 3328) << 4)
_INVALID: Final = 511
_DENSE_SCALES: Final = ((2046, 0, 2), (8187, 2046, 3), (24567, 8187, 4), (65532, 24567, 5))
"""Up to which distance [mm], where the scale begins, and its step."""


def ultra_words(mm: Sequence[int]) -> list[int]:
    """Return 32 words of 96 distances; the 97th is the first one of the next capsule. 0: none.

    A word has every third distance, and the two after it as differences, from itself and from the next word's. A
    difference that does not fit is no distance, as with the sensor.
    """
    values, bases = zip(*(_scaled(one) for one in mm[::3]), strict=True)
    words = []
    for at in range(len(bases) - 1):
        here, following = bases[at], bases[at + 1]
        one = _difference(mm[3 * at + 1], following if here[0] == 0 and following[0] else here)
        two = _difference(mm[3 * at + 2], following)
        words.append(values[at] | one << 12 | two << 22)
    return words


def _scaled(mm: int) -> tuple[int, tuple[int, int]]:
    """Return a distance's 12 bits, and what they say: the distance and the power of two of the scale's step."""
    if mm > _FAR_MM:
        return 0, (0, 0)
    from_mm, least, shift = next(one for one in _SCALES if mm >= one[0])
    steps = (mm - from_mm) >> shift
    return least + steps, (from_mm + (steps << shift), shift)


def _difference(mm: int, base: tuple[int, int]) -> int:
    """Return ten signed bits."""
    steps = (mm - base[0]) >> base[1]
    return steps & 0x3FF if mm and -_INVALID <= steps < _INVALID else _INVALID


def ultra_dense_cabin(first_mm: int, second_mm: int) -> bytes:
    """Return two distances of 20 bits each; 0: none."""
    first, second = _dense_word(first_mm), _dense_word(second_mm)
    return struct.pack("<HHB", first & 0xFFFF, second & 0xFFFF, first >> 16 | second >> 16 << 4)


def _dense_word(mm: int) -> int:
    """Return a distance and its scale, without its quality."""
    for scale, (most_mm, from_mm, step_mm) in enumerate(_DENSE_SCALES):
        if mm <= most_mm:
            return (mm - from_mm) // step_mm << 2 | scale
    return 0
