"""The contents of RPLIDAR capsules: distances and corrections of angles. Pure numpy, one capsule at a time.

Each function returns distances [mm], 0 for none, and what is subtracted from the evenly spaced angles [degrees], both
of shape (n,). Source: Slamtec SDK, `handler_capsules.cpp`, described in the protocol v2.8.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_EXPRESS: Final = np.dtype([("first", "<u2"), ("second", "<u2"), ("offsets", "u1")])
_SCALES: Final = ((3328, 16384, 4), (1792, 4096, 3), (1280, 2048, 2), (512, 512, 1), (0, 0, 0))
"""Of an ultra capsule's 12 bits: from which value on, its distance [mm], and the power of two of a step."""
_NO_PREDICTION: Final = (-512, 511)
_ULTRA_NEAR_MM: Final = 50
_DENSE_SCALES: Final = ((0x3FF, 2, 0), (0x7FF, 3, 2046), (0xFFF, 4, 8187), (0x1FFF, 5, 24567))
"""Of an ultra dense sample, by its two lowest bits: mask, factor and beginning of its distance [mm]."""
_SMOOTH_MM: Final = 2


def express(body: bytes) -> tuple[Floats, Floats]:
    """Decode 16 cabins of two samples: the angle's correction is in the cabin, 0 to 63 eighths of a degree."""
    cabins = np.frombuffer(body, _EXPRESS)
    words = np.stack([cabins["first"], cabins["second"]], axis=1).astype(np.int64)
    low = np.stack([cabins["offsets"] & 15, cabins["offsets"] >> 4], axis=1).astype(np.int64)
    offset = low | (words & 3) << 4
    return (words & ~3).ravel() / 4.0, offset.ravel() / 8.0


def dense(body: bytes) -> tuple[Floats, Floats]:
    """Decode 40 distances."""
    mm = np.frombuffer(body, "<u2").astype(np.float64)
    return mm, np.zeros(mm.size)


def ultra(body: bytes, following: bytes) -> tuple[Floats, Floats]:
    """Decode 32 words of one distance and two predictions; following: the words of the next capsule."""
    words = np.frombuffer(body + following[:4], "<u4").astype(np.int64)
    base_mm, power = _scaled(words & 0xFFF)
    one, two = _signed(words[:-1] >> 12 & 0x3FF), _signed(words[:-1] >> 22 & 0x3FF)
    from_next = (base_mm[:-1] == 0) & (base_mm[1:] != 0)
    first = np.where(from_next, base_mm[1:], base_mm[:-1])
    first_power = np.where(from_next, power[1:], power[:-1])
    mm = np.stack(
        [base_mm[:-1], _predicted(first, one, first_power), _predicted(base_mm[1:], two, power[1:])], axis=1
    ).ravel()
    return mm.astype(np.float64), _ultra_offset_deg(mm)


def _scaled(value: Integers) -> tuple[Integers, Integers]:
    mm, power = np.zeros_like(value), np.zeros_like(value)
    below = np.ones(value.shape, np.bool_)
    for least, from_mm, shift in _SCALES:
        here = below & (value >= least)
        mm[here], power[here] = from_mm + ((value[here] - least) << shift), shift
        below &= ~here
    return mm, power


def _signed(value: Integers) -> Integers:
    return np.where(value >= 512, value - 1024, value)


def _predicted(base_mm: Integers, prediction: Integers, power: Integers) -> Integers:
    return np.where(np.isin(prediction, _NO_PREDICTION), 0, base_mm + (prediction << power))


def _ultra_offset_deg(mm: Integers) -> Floats:
    """Return the triangulation's correction; in the sensor's own fixed-point steps of 1/65536 rad."""
    quarter_mm = np.maximum(mm * 4, 1)
    k = 98361 // quarter_mm
    far = int(8 * np.pi / 180 * 65536) - (k << 6) - k**3 // 98304
    near = int(7.5 * np.pi / 180 * 65536)
    return np.degrees(np.where(mm >= _ULTRA_NEAR_MM, far, near) / 65536.0)


def ultra_dense(body: bytes, before_mm: int) -> tuple[Floats, Floats]:
    """Decode 32 cabins of two samples of 20 bits; before_mm: the sample before, with which a near one is averaged."""
    cabins = np.frombuffer(body, _EXPRESS)
    high = np.stack([cabins["offsets"] & 15, cabins["offsets"] >> 4], axis=1).astype(np.int64)
    words = (np.stack([cabins["first"], cabins["second"]], axis=1).astype(np.int64) | high << 16).ravel()
    kind = words & 3
    mm = np.zeros(words.shape, np.int64)
    for scale, (mask, factor, from_mm) in enumerate(_DENSE_SCALES):
        here = kind == scale
        mm[here] = (words[here] >> 2 & mask) * factor + from_mm
    smooth, last = [], before_mm
    for one, scale in zip(mm.tolist(), kind.tolist(), strict=True):
        last = (one + last) // 2 if scale == 0 and one and last and abs(one - last) <= _SMOOTH_MM else one
        smooth.append(last)
    return np.array(smooth, np.float64), np.zeros(len(smooth))
