"""The age of a command on the car's clock alone, and its order in the series.

The car numbers its heartbeats and remembers when it sent each. An operator echoes the newest number received, so a
command is at most as old as that heartbeat: the time covers the way to the operator, the way back, and every queue in
between, and no two clocks need to agree.
"""

from collections import deque

from wallride.drivers.api import Clock

REMEMBERED_BEATS = 512
"""Number of heartbeats whose sending times are kept: ten seconds at 50 Hz. Older ones count as unknown: a command that
old is not obeyed anyway."""
_U32 = 0xFFFF_FFFF
_HALF = 0x8000_0000


def newer(number: int, than: int) -> bool:
    """Compare 32-bit counters that wrap around: at most 2**31 ahead is newer (serial numbers, RFC 1982)."""
    return 0 < (number - than) & _U32 < _HALF


class Beats:
    """The car's numbered heartbeats and the sending time of each.

    number: the newest; 0 before the first.
    """

    def __init__(self, clock: Clock, number: int = 0) -> None:
        self._clock = clock
        self._sent_s: deque[float] = deque(maxlen=REMEMBERED_BEATS)
        self.number = number

    def count_sent(self) -> int:
        """Count one more heartbeat, which is sent now; return its number."""
        self.number = (self.number + 1) & _U32
        self._sent_s.append(self._clock())
        return self.number

    def sent_at_s(self, number: int) -> float | None:
        """Return the sending time of a heartbeat; None for one of the future, of another car or forgotten."""
        back = (self.number - number) & _U32
        return self._sent_s[-1 - back] if back < len(self._sent_s) else None
