"""Age of ROS 2's drive commands, which echo no heartbeat: by how much each is later than the fastest of its series.

The sender's stamp is of another clock. The least difference between arrival and stamp that was seen is the way of a
command that did not wait; what is later than that by the expiry waited somewhere, and is stale. Until a series is long
enough for a comparison none of it is obeyed. Pure: the arrival is an argument.

Two stamps are compared so, each with its own clock: the time of sending, which ROS 2 attaches, and the stamp of the
header where it is not 0, which many planners copy from the scan that they answer. The first grows old on the way, the
second also in a planner that is stuck on an old scan.
"""

import math
from dataclasses import dataclass
from typing import Final

from runtime.teleop.rejections import Refusal

WARM_UP_S: Final = 0.5
"""Duration of a series after which its commands count."""
SILENT_S: Final = 1.0
"""Silence after which a series is compared anew, and another publisher may follow."""
MAX_DRIFT: Final = 1e-3
"""Maximum drift of two clocks: the least difference is forgotten at this rate."""


@dataclass(frozen=True, slots=True)
class Stamps:
    """Times of a command by the sender's clocks: sent_s of its sending, header_s of its header, None without one."""

    sent_s: float
    header_s: float | None = None


class _Clock:
    """The least difference between arrivals and the stamps of one clock."""

    def __init__(self) -> None:
        self._least_s = self._arrival_s = math.inf

    def late_s(self, stamp_s: float, arrival_s: float) -> float:
        """Return by how much a command is later than the fastest with a stamp of this clock, itself included."""
        elapsed_s = max(0.0, arrival_s - self._arrival_s)
        way_s = arrival_s - stamp_s
        self._least_s = min(self._least_s + MAX_DRIFT * elapsed_s, way_s)
        self._arrival_s = arrival_s
        return way_s - self._least_s


class DriveSeries:
    """The series of one publisher. until_s: end of the command that was judged last and passed."""

    def __init__(self, expiry_s: float) -> None:
        self._expiry_s = expiry_s
        self._publisher = b""
        self._sequence = 0
        self._since_s = self._arrival_s = -math.inf
        self._sending, self._header = _Clock(), _Clock()
        self.until_s = -math.inf

    def judge(self, sequence: int, stamps: Stamps, publisher: bytes, arrival_s: float) -> Refusal | None:
        """Return why a command does not count; None, with until_s set, if it does."""
        silent = arrival_s - self._arrival_s > SILENT_S
        if publisher != self._publisher and not silent:
            return Refusal.TOO_MANY
        if publisher != self._publisher or silent:
            self._publisher, self._since_s = publisher, arrival_s
            self._sending, self._header = _Clock(), _Clock()
        elif sequence <= self._sequence:
            return Refusal.REPLAY
        self._sequence, self._arrival_s = sequence, arrival_s
        late_s = self._sending.late_s(stamps.sent_s, arrival_s)
        if stamps.header_s is not None:
            late_s = max(late_s, self._header.late_s(stamps.header_s, arrival_s))
        if arrival_s - self._since_s < WARM_UP_S:
            return Refusal.UNCOMPARED
        if late_s >= self._expiry_s:
            return Refusal.STALE
        self.until_s = arrival_s - late_s + self._expiry_s
        return None
