"""Age of ROS 2's drive commands, which echo no heartbeat: by how much each is later than the fastest of its series.

The sender's stamp is of another clock. The least difference between arrival and stamp that was seen is the way of a
command that did not wait; what is later than that by the expiry waited somewhere, and is stale. Until a series is long
enough for a comparison none of it is obeyed. Pure: the arrival is an argument.

Two stamps are compared so, each with its own clock: the time of sending, which ROS 2 attaches, and the stamp of the
header where it is not 0, which many planners copy from the scan that they answer. The first grows old on the way, the
second also in a planner that is stuck on an old scan.

Waiting never makes a stamp go back behind the one before. A clock that was set back does: its stamps are stale too,
until they have agreed with each other for a second; then they are those of a new clock, as a lidar's are.
"""

import math
from dataclasses import dataclass
from typing import Final

from wallride.runtime.teleop.rejections import Refusal

WARM_UP_S: Final = 0.5
"""Duration of a series after which its commands count."""
SILENT_S: Final = 1.0
"""Silence after which a series is compared anew, and another publisher may follow."""
MAX_DRIFT: Final = 1e-3
"""Maximum drift of two clocks: the least difference is forgotten at this rate."""
NEW_CLOCK_AFTER_S: Final = 1.0
AGREES_WITHIN_S: Final = 0.1
"""Maximum change of the difference between arrivals and stamps of one clock that was set back."""


@dataclass(frozen=True, slots=True)
class Stamps:
    """Times of a command by the sender's clocks: sent_s of its sending, header_s of its header, None without one."""

    sent_s: float
    header_s: float | None = None


class _Clock:
    """The least difference between arrivals and the stamps of one clock."""

    def __init__(self) -> None:
        self._least_s = self._arrival_s = math.inf
        self._stamp_s = -math.inf
        self._set_back: tuple[float, float] | None = None
        """Arrival and difference of the first command after the clock went back."""

    def late_s(self, stamp_s: float, arrival_s: float) -> float:
        """Return by how much a command is later than the fastest with a stamp of this clock, itself included."""
        elapsed_s = max(0.0, arrival_s - self._arrival_s)
        way_s = arrival_s - stamp_s
        self._least_s = min(self._least_s + MAX_DRIFT * elapsed_s, way_s)
        self._arrival_s = arrival_s
        if self._is_new(stamp_s, arrival_s, way_s - self._least_s):
            self._least_s, self._stamp_s, self._set_back = way_s, stamp_s, None
        return way_s - self._least_s

    def _is_new(self, stamp_s: float, arrival_s: float, late_s: float) -> bool:
        """Return whether the stamps went back, and have since agreed with each other better than with those before."""
        if self._set_back is not None:
            since_s, way_s = self._set_back
            if abs(arrival_s - stamp_s - way_s) < min(AGREES_WITHIN_S, late_s):
                return arrival_s - since_s >= NEW_CLOCK_AFTER_S
        self._set_back = (arrival_s, arrival_s - stamp_s) if stamp_s < self._stamp_s else None
        if self._set_back is None:
            self._stamp_s = stamp_s
        return False


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
