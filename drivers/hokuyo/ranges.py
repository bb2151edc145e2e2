"""Decoding of the scans of the stream in use while driving (MD).

A value is a distance only between DMIN and DMAX of the sensor. All else is a code: 65533 "no return" on a UST-10LX, 0
to 19 the error codes of an URG-04LX. Taken as metres they are walls at 65 m and obstacles at 4 mm.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.drivers.value import value

_DIGITS: Final = bytes(range(0x30, 0x70))
_MM_PER_M: Final = np.float32(1000)
_WEIGHTS: Final = np.array([4096, 64, 1], np.float32)
_THREE_ZEROS: Final = np.float32(0x30 * (4096 + 64 + 1))


LAST_ERROR_CODE: Final = 19
NOTHING_CAME_BACK_MM: Final = 65533
"""The largest value that says so: those above it are faults of the measurement."""


@value(eq=False)
class SampleReturns:
    """The samples of one MD scan, and of which sensor: beam count, limits [mm], 1 where it is upside down."""

    samples: bytes
    sensor: tuple[int, int, int, int]

    def marked_m(self) -> npt.NDArray[np.float32]:
        """Return the ranges as REP 117 has them; see `wallride.drivers.api.Returns`."""
        beam_count, range_min_mm, range_max_mm, reverse = self.sensor
        mm = _millimetres(self.samples, beam_count)
        mm = mm[::-1] if reverse else mm
        ranges_m: npt.NDArray[np.float32] = mm / _MM_PER_M
        ranges_m[mm < range_min_mm] = -np.inf
        ranges_m[mm > range_max_mm] = np.inf
        ranges_m[(mm <= LAST_ERROR_CODE) | (mm > NOTHING_CAME_BACK_MM)] = np.nan
        return ranges_m


class RangeDecoder:
    """Decodes full MD scans of one sensor: shape (beam_count,), float32 metres, NaN outside the sensor's limits.

    block_bytes: approximate length of the block of one scan.
    """

    def __init__(self, beam_count: int, range_min_mm: int, range_max_mm: int, *, reverse: bool = False) -> None:
        self.block_bytes = 3 * beam_count * 66 // 64
        self._sensor = beam_count, range_min_mm, range_max_mm, int(reverse)

    def returns(self, samples: bytes) -> SampleReturns:
        """Return what these samples, which could be decoded, say of beams without a distance."""
        return SampleReturns(samples, self._sensor)

    def decode(self, samples: bytes) -> npt.NDArray[np.float32] | None:
        """Return a fresh read-only array, or None when these are not `beam_count` samples of three digits."""
        return decode_samples(samples, *self._sensor)


@accelerated
def decode_samples(
    samples: bytes, beam_count: int, range_min_mm: int, range_max_mm: int, reverse: int
) -> npt.NDArray[np.float32] | None:
    """Return the result of RangeDecoder.decode; reverse: 1 for a sensor mounted upside down, else 0.

    The sum of three characters stays below 2**24, so millimetres are exact in float32 and only the division rounds.
    """
    if len(samples) != 3 * beam_count or samples.translate(None, _DIGITS):
        return None
    characters = np.frombuffer(samples, np.uint8).reshape(beam_count, 3).astype(np.float32)
    mm = characters @ _WEIGHTS - _THREE_ZEROS
    mm = mm[::-1] if reverse else mm
    ranges_m: npt.NDArray[np.float32] = mm / _MM_PER_M
    ranges_m[(mm < range_min_mm) | (mm > range_max_mm)] = np.nan
    ranges_m.setflags(write=False)
    return ranges_m


def _millimetres(samples: bytes, beam_count: int) -> npt.NDArray[np.float32]:
    characters = np.frombuffer(samples, np.uint8).reshape(beam_count, 3).astype(np.float32)
    millimetres: npt.NDArray[np.float32] = characters @ _WEIGHTS - _THREE_ZEROS
    return millimetres
