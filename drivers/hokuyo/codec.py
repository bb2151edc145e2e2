"""SCIP 2.x on the wire: command lines out, checked reply blocks in. No port, no clock, no log.

    command   MD0000108000000 [;note] LF
    block     echo LF  status+sum LF  { up to 64 characters + sum LF }  LF

Sum: the low six bits of the sum of the line's bytes, plus 0x30. On KEY:VALUE; lines (PP, VV, II) it covers the text
before the semicolon. Six bits let one error in 64 through, and any flip of the top two bits, so what is decoded later
is range-checked as well. Source: SCIP 2.0 specification C-42-03320B, and vendor code where that is unclear.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.drivers.value import value

BLOCK_LIMIT_BYTES: Final = 8192
"""Maximum length of a block: a full scan with intensities is 6.7 kB. Without a blank line for longer than this, the
bytes are out of step."""

SCAN_FAMILIES: Final = frozenset({b"MD", b"MS", b"ME", b"GD", b"GS", b"GE", b"ND", b"NE", b"HD", b"HE"})

_ECHO_LIMIT_CHARS: Final = 40  # the longest is 15 characters, a semicolon and a note of 16
_LINE_CHARS: Final = 64
_ROW_BYTES: Final = _LINE_CHARS + 2  # + sum + LF
_SUM_OF: Final = bytes((total & 0x3F) + 0x30 for total in range(256))


def command(name: str) -> bytes:
    """Return one command line."""
    return f"{name}\n".encode("ascii")


def stream_command(first_step: int, last_step: int) -> bytes:
    """Return MD: every step of every scan without end; it turns the laser on by itself."""
    return command(f"MD{first_step:04d}{last_step:04d}00000")


def checksum(text: bytes) -> int:
    """Return the checksum character of a line."""
    return (sum(text) & 0x3F) + 0x30


@value()
class ReplyBlock:
    """One reply, every checksum verified and stripped.

    status: two characters, or the single one of SCIP 1.1.
    lines: the data lines as sent; of a scan exactly (time stamp, samples), the sample lines joined, because a sample
        may straddle two lines.
    """

    echo: bytes
    status: str
    lines: tuple[bytes, ...] = ()


def _ignore(_what: str) -> None:
    pass


class ScipDeframer:
    """Finds blocks in a byte stream, whatever the chunking; discards at most `limit_bytes` of garbage at a time.

    limit_bytes: may be raised for a sensor whose scans are longer.

    Never raises: an invalid block is dropped and its kind passed to `count`: "checksum" (a sum is wrong), "malformed"
    (no echo, no status), "oversized" (no blank line where one was due). The next blank line resynchronizes.
    """

    def __init__(self, count: Callable[[str], None] = _ignore, *, limit_bytes: int = BLOCK_LIMIT_BYTES) -> None:
        self._count = count
        self.limit_bytes = limit_bytes
        self._rest = b""
        self._lost = False

    def reset(self) -> None:
        """Drop an incomplete block."""
        self._rest = b""
        self._lost = False

    def feed(self, chunk: bytes) -> list[ReplyBlock]:
        """Add bytes and return the blocks they completed, oldest first."""
        blocks = []
        begin = 0
        search_from = max(0, len(self._rest) - 1)
        data = self._rest + chunk
        while (end := data.find(b"\n\n", search_from)) >= 0:
            if (block := self._close(data[begin:end])) is not None:
                blocks.append(block)
            begin = search_from = end + 2
        self._rest = data[begin:]
        if len(self._rest) > self.limit_bytes + 1:  # it cannot end in time any more, whatever follows
            self._give_up()
        return blocks

    def _close(self, raw: bytes) -> ReplyBlock | None:
        if self._lost:
            self._lost = False
            return None
        if not raw:
            return None  # more blank lines than needed
        if len(raw) > self.limit_bytes:
            self._count("oversized")
            return None
        result = parse_block(raw)
        if isinstance(result, str):
            self._count(result)
            return None
        return result

    def _give_up(self) -> None:
        if not self._lost:
            self._count("oversized")
            self._lost = True
        self._rest = self._rest[-1:]  # the last byte may be the first half of the blank line


def parse_block(raw: bytes) -> ReplyBlock | str:
    """Check one block without its two closing line feeds; return the kind of its fault for an invalid one."""
    parts = split_scan(raw)
    if parts is not None and parts[0][:2] in SCAN_FAMILIES:
        echo, status, stamp, samples = parts
        return ReplyBlock(echo, status.decode("ascii"), (stamp, samples))
    return _parse_carefully(raw)


@accelerated
def split_scan(raw: bytes) -> tuple[bytes, bytes, bytes, bytes] | None:
    """Return echo, status, stamp and samples of a scan as sensors send it, all sums verified; None for anything else.

    The path of every scan of a healthy stream; the faults of other blocks are determined by `_parse_carefully`.
    """
    echo, _, rest = raw.partition(b"\n")
    status, _, body = rest.partition(b"\n")
    stamp, _, data = body.partition(b"\n")
    if not 0 < len(echo) <= _ECHO_LIMIT_CHARS or len(status) != 3 or len(stamp) < 2 or not (echo + status).isascii():
        return None
    if checksum(status[:2]) != status[2] or checksum(stamp[:-1]) != stamp[-1]:
        return None
    samples = join_rows(data)
    return None if samples is None else (echo, status[:2], stamp[:-1], samples)


def _parse_carefully(raw: bytes) -> ReplyBlock | str:
    echo, _, rest = raw.lstrip(b"\n").partition(b"\n")
    status, _, body = rest.partition(b"\n")
    if not 0 < len(echo) <= _ECHO_LIMIT_CHARS or not (echo + status).isascii():
        return "malformed"
    if len(status) == 3:
        if checksum(status[:2]) != status[2]:
            return "checksum"
    elif len(status) != 1:
        return "malformed"
    if not body:
        return ReplyBlock(echo, status[:2].decode("ascii"))
    lines = _check_scan(body) if echo[:2] in SCAN_FAMILIES else _check_lines(body)
    return "checksum" if lines is None else ReplyBlock(echo, status[:2].decode("ascii"), lines)


def _check_scan(body: bytes) -> tuple[bytes, ...] | None:
    stamp, _, data = body.partition(b"\n")
    if len(stamp) < 2 or checksum(stamp[:-1]) != stamp[-1]:
        return None
    if not data:
        return (stamp[:-1],)
    samples = join_sample_lines(data)
    return None if samples is None else (stamp[:-1], samples)


def join_sample_lines(data: bytes) -> bytes | None:
    """Verify sample lines (the last one without its LF) and join them; None when a sum is wrong."""
    samples = join_rows(data)
    return _join_irregular(data) if samples is None else samples


@accelerated
def join_rows(data: bytes) -> bytes | None:
    """Verify and join lines of exactly 64 characters and a shorter last one, as sensors send them; None for others.

    All but the last one are verified as one table.
    """
    row_count, tail_bytes = divmod(len(data), _ROW_BYTES)
    if tail_bytes < 2 or data.count(b"\n") != row_count or checksum(tail := data[-tail_bytes:-1]) != data[-1]:
        return None
    rows_bytes = row_count * _ROW_BYTES
    table = np.frombuffer(data, np.uint8, rows_bytes).reshape(row_count, _ROW_BYTES)
    samples = table[:, :_LINE_CHARS]
    totals = np.add.reduce(samples, axis=1, dtype=np.uint8)  # wraps at 256, which leaves the low six bits alone
    said = data[_LINE_CHARS:rows_bytes:_ROW_BYTES]
    ends = data[_LINE_CHARS + 1 : rows_bytes : _ROW_BYTES]
    if totals.tobytes().translate(_SUM_OF) != said or ends != b"\n" * row_count:
        return None
    return samples.tobytes() + tail


def _join_irregular(data: bytes) -> bytes | None:
    lines = data.split(b"\n")
    if all(len(line) > 1 and checksum(line[:-1]) == line[-1] for line in lines):
        return b"".join(line[:-1] for line in lines)
    return None


def _check_lines(body: bytes) -> tuple[bytes, ...] | None:
    lines = tuple(map(_check_line, body.split(b"\n")))
    return None if b"" in lines else tuple(lines)


def _check_line(line: bytes) -> bytes:
    """Return the text without sum (and semicolon), b"" when the sum is wrong; some firmware sums the semicolon too."""
    text, end = line[:-1], line[-1:]
    if text.endswith(b";"):
        value = text[:-1]
        return value if end[0] in {checksum(value), checksum(text)} else b""
    return text if text and checksum(text) == end[0] else b""
