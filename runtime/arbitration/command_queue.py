"""The command queue: one slot per source, in the priority order of the mux, each entry with its expiry."""

import math
from collections.abc import Callable, Mapping, Sequence

from wallride.drivers.api import Clock
from wallride.runtime.arbitration.command import QueueEntry, Source
from wallride.runtime.arbitration.queues import NEVER_S, PriorityQueue


class CommandQueue:
    """Connects the tasks, which put commands and limits, to the mux, which reads them.

    An entry expires by its measurement, not by its delivery: the source passes the time until which its oldest input is
    valid. A task that keeps running on a frozen scan thus falls silent by itself.

    last_put_s: time of the last entry of any source; minus infinity before the first.
    on_put, on_withdrawn: called with every entry (and its expiry), and with every one that was withdrawn.
    """

    def __init__(self, order: Sequence[Source], clock: Clock) -> None:
        self.order = tuple(order)
        self.on_put: Callable[[QueueEntry, float], None] = _forget
        self.on_withdrawn: Callable[[Source], None] = _forget
        self._clock = clock
        self._queue: PriorityQueue[Source, QueueEntry] = PriorityQueue(clock)
        self._put_at_s: dict[Source, float] = {}
        self.last_put_s = -math.inf

    def reorder(self, order: Sequence[Source]) -> None:
        """Change the priority order, also of the entries in force, and wake the mux."""
        if tuple(order) != self.order:
            self.order = tuple(order)
            self._queue.change_priorities(self.order.index)
            self._queue.wake()

    def put(self, entry: QueueEntry, *, expires_at_s: float = NEVER_S) -> None:
        """Put an entry: it replaces the source's earlier one and wakes the mux."""
        self._put_at_s[entry.source] = self.last_put_s = self._clock()
        self._queue.put(entry.source, entry, priority=self.order.index(entry.source), expires_at_s=expires_at_s)
        self.on_put(entry, expires_at_s)

    def withdraw(self, source: Source) -> None:
        """Withdraw an entry, for example of a latched e-stop that was reset."""
        self._queue.discard(source)
        self.on_withdrawn(source)
        self._queue.wake()

    def live(self) -> list[QueueEntry]:
        """Return the entries in force, most urgent first, and change nothing."""
        return self._queue.live()

    def sweep(self) -> list[QueueEntry]:
        """Drop what has expired, and return the entries in force, most urgent first: for the mux alone."""
        return self._queue.sweep()

    def entry(self, source: Source) -> QueueEntry | None:
        """Return the entry of one source; None when it is silent."""
        return self._queue.peek(source)

    async def changed(self) -> None:
        """Wait for a new entry or a tick."""
        await self._queue.changed()

    def has_expired(self) -> bool:
        """Tell whether an entry has expired since the last `sweep`."""
        return self._queue.has_expired()

    def take_change(self) -> bool:
        """Tell whether `changed` would return at once, and clear its event, so that it waits for the next change."""
        return self._queue.take_change()

    def tick(self) -> None:
        """Wake the mux without a new entry: a mux that only forwards goes silent instead of stopping."""
        self._queue.wake()

    def ages_s(self) -> Mapping[Source, float]:
        """Return the age of each source's last entry; sources without any entry are missing."""
        now_s = self._clock()
        return {source: now_s - put_s for source, put_s in self._put_at_s.items()}


def _forget(*_: object) -> None:
    """Ignore the event."""
