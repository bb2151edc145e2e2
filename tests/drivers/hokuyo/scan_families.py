"""Commands and scans of all families (several echoes, intensities) that a sensor knows, beside the one that drives."""

from dataclasses import dataclass

import numpy as np

from wallride.drivers.hokuyo.codec import SCAN_FAMILIES, command
from wallride.drivers.hokuyo.replies import decode_number

DIGIT_ZERO, DIGIT_MAX = np.uint8(0x30), 63


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
    ranges_mm: np.ndarray
    intensities: np.ndarray | None = None
    echoes_mm: tuple[tuple[int, ...], ...] | None = None


def decode_scan(block):
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


def decode_numbers(samples, *, chars):
    """Split samples into numbers of `chars` characters; None for an incomplete number or an invalid digit."""
    digits = np.frombuffer(samples, np.uint8) - DIGIT_ZERO
    if not len(digits) or len(digits) % chars or digits.max() > DIGIT_MAX:
        return None
    weights = 64 ** np.arange(chars - 1, -1, -1, dtype=np.int32)
    return digits.reshape(-1, chars).astype(np.int32) @ weights


def _remaining(echo):
    streamed = echo[:1] in {b"M", b"N"}
    digits = echo.partition(b";")[0][-2:]
    return int(digits) if streamed and digits.isdigit() else None


def _decode_echoes(stamp_ms, remaining, samples, *, with_intensity):
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


def scan_command(asked) -> bytes:
    """Return a command for scans: family, steps, steps a sample; of a stream scans left out, their number, a note."""
    stream = f"{asked['skip']:01d}{asked['scans']:02d}" if asked["cmd"][0] == "M" else ""
    note = f";{asked['string']}" if asked.get("string") else ""
    return command(f"{asked['cmd']}{asked['start']:04d}{asked['end']:04d}{asked['cluster']:02d}{stream}{note}")
