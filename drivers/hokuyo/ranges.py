"""Decoding of scan data: a fast path for the stream in use while driving (MD), and one for every other family.

A value is a distance only between DMIN and DMAX of the sensor. All else is a code: 65533 "no return" on a UST-10LX, 0
to 19 the error codes of an URG-04LX. Taken as metres they are walls at 65 m and obstacles at 4 mm.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from drivers.accelerated import accelerated
from drivers.hokuyo.codec import SCAN_FAMILIES, ReplyBlock
from drivers.hokuyo.replies import decode_number

_ZERO: Final = np.uint8(0x30)
_DIGITS: Final = bytes(range(0x30, 0x70))
_DIGIT_MAX: Final = 63
_MM_PER_M: Final = np.float32(1000)
_WEIGHTS: Final = np.array([4096, 64, 1], np.float32)
_THREE_ZEROS: Final = np.float32(0x30 * (4096 + 64 + 1))


class RangeDecoder:
    """Decodes full MD scans of one sensor: shape (beam_count,), float32 metres, NaN outside the sensor's limits.

    block_bytes: approximate length of the block of one scan.
    """

    def __init__(self, beam_count: int, range_min_mm: int, range_max_mm: int, *, reverse: bool = False) -> None:
        self.block_bytes = 3 * beam_count * 66 // 64
        self._sensor = beam_count, range_min_mm, range_max_mm, int(reverse)

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


@dataclass(frozen=True, slots=True, eq=False)
class RawScan:
    """A scan of any family as the sensor sent it: codes are still codes.

    stamp_ms: the sensor's 24-bit clock. remaining: scans still to come, from the echo of a stream; None otherwise.
    ranges_mm: shape (n,), int32; of several echoes the first that was sent.
    intensities: shape (n,), int32, or None where the family has none.
    echoes_mm: for ND, NE, HD, HE all echoes of each step.
    """

    stamp_ms: int
    remaining: int | None
    ranges_mm: npt.NDArray[np.int32]
    intensities: npt.NDArray[np.int32] | None = None
    echoes_mm: tuple[tuple[int, ...], ...] | None = None


def decode_scan(block: ReplyBlock) -> RawScan | None:
    """Decode a scan block of any family; None when it holds no scan or its characters are invalid."""
    family = block.echo[:2]
    if family not in SCAN_FAMILIES or len(block.lines) != 2:
        return None
    stamp_ms = decode_number(block.lines[0])
    if stamp_ms is None or len(block.lines[0]) != 4:
        return None
    remaining = _remaining(block.echo)
    samples = block.lines[1]
    if family in {b"ND", b"NE", b"HD", b"HE"}:
        return _decode_echoes(stamp_ms, remaining, samples, with_intensity=family.endswith(b"E"))
    numbers = decode_numbers(samples, chars=2 if family.endswith(b"S") else 3)
    if numbers is None or (family.endswith(b"E") and len(numbers) % 2):
        return None
    if family.endswith(b"E"):
        return RawScan(stamp_ms, remaining, numbers[::2], numbers[1::2])
    return RawScan(stamp_ms, remaining, numbers)


def decode_numbers(samples: bytes, *, chars: int) -> npt.NDArray[np.int32] | None:
    """Split samples into numbers of `chars` characters; None for an incomplete number or an invalid digit."""
    digits = np.frombuffer(samples, np.uint8) - _ZERO
    if not len(digits) or len(digits) % chars or digits.max() > _DIGIT_MAX:
        return None
    weights = 64 ** np.arange(chars - 1, -1, -1, dtype=np.int32)
    numbers: npt.NDArray[np.int32] = digits.reshape(-1, chars).astype(np.int32) @ weights
    return numbers


def _remaining(echo: bytes) -> int | None:
    streamed = echo[:1] in {b"M", b"N"}
    digits = echo.partition(b";")[0][-2:]
    return int(digits) if streamed and digits.isdigit() else None


def _decode_echoes(stamp_ms: int, remaining: int | None, samples: bytes, *, with_intensity: bool) -> RawScan | None:
    """Read steps of one to three echoes, joined by "&": 3 characters each, 6 with intensity."""
    chars = 6 if with_intensity else 3
    steps: list[list[bytes]] = []
    at = 0
    while at < len(samples):
        joined = samples[at : at + 1] == b"&"
        at += joined
        echo = samples[at : at + chars]
        if len(echo) != chars or (joined and not steps):
            return None
        if joined:
            steps[-1].append(echo)
        else:
            steps.append([echo])
        at += chars
    ranges = [[decode_number(echo[:3]) for echo in step] for step in steps]
    if not ranges or any(value is None for step in ranges for value in step):
        return None
    echoes_mm = tuple(tuple(value for value in step if value is not None) for step in ranges)
    intensities = decode_numbers(b"".join(step[0][3:] for step in steps), chars=3) if with_intensity else None
    first_mm = np.array([step[0] for step in echoes_mm], np.int32)
    return RawScan(stamp_ms, remaining, first_mm, intensities, echoes_mm)
