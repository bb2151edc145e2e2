"""Age of ROS 2's drive commands, which echo no heartbeat: by how much each is later than the fastest of its series.

The sender's stamp is of another clock. The least difference between arrival and stamp that was seen is the way of a
command that did not wait; what is later than that by the expiry waited somewhere, and is stale. Until a series is long
enough for a comparison none of it is obeyed. Pure: the arrival is an argument.
"""

import math
from typing import Final

from runtime.teleop.rejections import Refusal

WARM_UP_S: Final = 0.5
"""Duration of a series after which its commands count."""
SILENT_S: Final = 1.0
"""Silence after which a series is compared anew, and another publisher may follow."""
MAX_DRIFT: Final = 1e-3
"""Maximum drift of two clocks: the least difference is forgotten at this rate."""


class DriveSeries:
    """The series of one publisher. until_s: end of the command that was judged last and passed."""

    def __init__(self, expiry_s: float) -> None:
        self._expiry_s = expiry_s
        self._publisher = b""
        self._sequence = 0
        self._since_s = self._arrival_s = -math.inf
        self._least_s = math.inf
        self.until_s = -math.inf

    def judge(self, sequence: int, stamp_s: float, publisher: bytes, arrival_s: float) -> Refusal | None:
        """Return why a command does not count; None, with until_s set, if it does."""
        silent = arrival_s - self._arrival_s > SILENT_S
        if publisher != self._publisher and not silent:
            return Refusal.TOO_MANY
        if publisher != self._publisher or silent:
            self._publisher, self._since_s, self._least_s = publisher, arrival_s, math.inf
        elif sequence <= self._sequence:
            return Refusal.REPLAY
        elapsed_s = max(0.0, arrival_s - self._arrival_s) if math.isfinite(self._least_s) else 0.0
        way_s = arrival_s - stamp_s
        self._least_s = min(self._least_s + MAX_DRIFT * elapsed_s, way_s)
        self._sequence, self._arrival_s = sequence, arrival_s
        late_s = way_s - self._least_s
        if arrival_s - self._since_s < WARM_UP_S:
            return Refusal.UNCOMPARED
        if late_s >= self._expiry_s:
            return Refusal.STALE
        self.until_s = arrival_s - late_s + self._expiry_s
        return None
