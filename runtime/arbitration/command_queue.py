"""The command queue: one slot per source, in the priority order of the mux, each entry with its expiry."""

import math
from collections.abc import Mapping, Sequence

from wallride.drivers.api import Clock
from wallride.runtime.arbitration.command import QueueEntry, Source
from wallride.runtime.arbitration.queues import NEVER_S, PriorityQueue


class CommandQueue(PriorityQueue[Source, QueueEntry]):
    """Connects the tasks, which put commands and limits, to the mux, which reads them.

    An entry expires by its measurement, not by its delivery: the source passes the time until which its oldest input is
    valid. A task that keeps running on a frozen scan thus falls silent by itself.

    last_put_s: time of the last entry of any source; minus infinity before the first.
    """

    def __init__(self, order: Sequence[Source], clock: Clock) -> None:
        super().__init__(clock)
        self.order = tuple(order)
        self._put_at_s: dict[Source, float] = {}
        self.last_put_s = -math.inf

    def reorder(self, order: Sequence[Source]) -> None:
        """Change the priority order, also of the entries in force, and wake the mux."""
        if tuple(order) != self.order:
            self.order = tuple(order)
            self.change_priorities(self.order.index)
            self.tick()

    def put(self, entry: QueueEntry, *, expires_at_s: float = NEVER_S) -> None:
        """Put an entry: it replaces the source's earlier one and wakes the mux."""
        self._put_at_s[entry.source] = self.last_put_s = self._clock()
        self.place(entry.source, entry, priority=self.order.index(entry.source), expires_at_s=expires_at_s)

    def withdraw(self, source: Source) -> None:
        """Withdraw an entry, for example of a latched e-stop that was reset."""
        self.discard(source)
        self.tick()

    def ages_s(self) -> Mapping[Source, float]:
        """Return the age of each source's last entry; sources without any entry are missing."""
        now_s = self._clock()
        return {source: now_s - put_s for source, put_s in self._put_at_s.items()}
