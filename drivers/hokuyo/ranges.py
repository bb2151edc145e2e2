"""Scan data to numbers: a fast path for the stream that the car drives by (MD), and one for every other family.

A value is a distance only between DMIN and DMAX of the sensor. All else is a code: 65533 "no return" on a UST-10LX,
0 to 19 the error codes of an URG-04LX. Passed on as metres they are walls at 65 m and obstacles at 4 mm.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from drivers.hokuyo.codec import SCAN_FAMILIES, Block
from drivers.hokuyo.replies import decode_number

_ZERO: Final = np.uint8(0x30)
_DIGITS: Final = bytes(range(0x30, 0x70))
_DIGIT_MAX: Final = 63
_MM_PER_M: Final = np.float32(1000)
_WEIGHTS: Final = np.array([4096, 64, 1, -0x30 * (4096 + 64 + 1)], np.float32)


class RangeDecoder:
    """Decodes full MD scans of one sensor: shape (beam_count,), float32 metres, NaN outside the sensor's limits.

    block_bytes: about how long the block of one scan is.
    The sum of three characters stays below 2**24, so millimetres are exact in float32 and only the division rounds.
    What counts here is the number of numpy calls: after 25 ms of sleep each costs 5 to 10 us, whatever it does.
    """

    def __init__(self, beam_count: int, range_min_mm: int, range_max_mm: int, *, reverse: bool = False) -> None:
        self._sample_chars = 3 * beam_count
        self.block_bytes = 3 * beam_count * 66 // 64
        self._range_min_mm = np.float32(range_min_mm)
        self._range_max_mm = np.float32(range_max_mm)
        self._characters = np.ones((beam_count, 4), np.float32)  # the last column takes the weight of three "0"
        self._sent = self._characters[:, :3]
        self._mm = np.empty(beam_count, np.float32)
        self._ordered_mm = self._mm[::-1] if reverse else self._mm
        self._bad = np.empty(beam_count, np.bool_)
        self._too_far = np.empty(beam_count, np.bool_)

    def decode(self, samples: bytes) -> npt.NDArray[np.float32] | None:
        """Return a fresh read-only array, or None when these are not `beam_count` samples of three digits."""
        if len(samples) != self._sample_chars:
            return None
        if samples.translate(None, _DIGITS):
            return None
        np.copyto(self._sent, np.frombuffer(samples, np.uint8).reshape(self._sent.shape))
        np.dot(self._characters, _WEIGHTS, out=self._mm)
        np.less(self._ordered_mm, self._range_min_mm, out=self._bad)
        np.greater(self._ordered_mm, self._range_max_mm, out=self._too_far)
        np.logical_or(self._bad, self._too_far, out=self._bad)
        ranges_m = np.divide(self._ordered_mm, _MM_PER_M)
        np.copyto(ranges_m, np.nan, where=self._bad)
        ranges_m.setflags(write=False)
        return ranges_m


@dataclass(frozen=True, slots=True, eq=False)
class RawScan:
    """A scan of any family as the sensor sent it: codes are still codes.

    stamp_ms: the sensor's 24-bit clock. remaining: scans still to come, as the echo of a stream says; None otherwise.
    ranges_mm: shape (n,), int32; of several echoes the first that was sent.
    intensities: shape (n,), int32, or None where the family has none.
    echoes_mm: for ND, NE, HD, HE all echoes of each step.
    """

    stamp_ms: int
    remaining: int | None
    ranges_mm: npt.NDArray[np.int32]
    intensities: npt.NDArray[np.int32] | None = None
    echoes_mm: tuple[tuple[int, ...], ...] | None = None


def decode_scan(block: Block) -> RawScan | None:
    """Decode a scan block of any family; None when it holds no scan or its characters make no sense."""
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
    """Cut samples into numbers of `chars` characters; None when they do not come out even or one is no digit."""
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
