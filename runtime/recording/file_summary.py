"""Duration of a recording from the summary at its end: a few small reads, whatever its size."""

import os
import struct
from pathlib import Path
from typing import IO, Final

from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.recording.disk import opened
from wallride.runtime.recording.recover import HEAD_B, MAGIC

FOOTER: Final = struct.Struct("<BQQQI")
"""Opcode and length, beginning of the summary and of its offsets, checksum."""
FOOTER_OPCODE: Final = 0x02
STATISTICS_OPCODE: Final = 0x0B
MESSAGE_TIMES: Final = struct.Struct("<26x2Q")
"""First and last time of a message [ns] in the statistics, behind six counts."""
MAX_SUMMARY_RECORDS: Final = 100_000
"""Records of the summary that are looked at: a chunk has one, and an hour of driving a few thousand."""


def duration_s(path: Path) -> float | None:
    """Return the time from the first message to the last; None for a file that is unreadable, or has no end."""
    try:
        with opened(path) as file:
            times = _message_times_ns(file)
    except (OSError, struct.error):  # the latter: shorter than what it claims to hold
        return None
    return (times[1] - times[0]) / NS if times is not None and times[1] >= times[0] > 0 else None


def _message_times_ns(file: IO[bytes]) -> tuple[int, int] | None:
    end = file.seek(0, os.SEEK_END) - len(MAGIC) - FOOTER.size
    if end < len(MAGIC):
        return None
    file.seek(end)
    opcode, _, at, _, _ = FOOTER.unpack(file.read(FOOTER.size))
    if opcode != FOOTER_OPCODE or file.read(len(MAGIC)) != MAGIC or not at:
        return None
    for _ in range(MAX_SUMMARY_RECORDS):
        if at >= end:
            return None
        file.seek(at)
        opcode, length = struct.unpack("<BQ", file.read(HEAD_B))
        if opcode == STATISTICS_OPCODE:
            first_ns, last_ns = MESSAGE_TIMES.unpack(file.read(MESSAGE_TIMES.size))
            return first_ns, last_ns
        at += HEAD_B + length
    return None
