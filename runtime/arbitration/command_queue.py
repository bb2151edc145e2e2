"""The command queue: one slot per source, in the priority order of the mux, each entry with its expiry."""

import math
from collections.abc import Callable, Mapping, Sequence

from drivers.api import Clock
from runtime.arbitration.command import Source, Word
from runtime.arbitration.queues import NEVER_S, PriorityQueue


class CommandQueue:
    """Connects the tasks, which put commands and limits, to the mux, which reads them.

    An entry expires by its measurement, not by its delivery: the source passes the time until which its oldest input is
    valid. A task that keeps running on a frozen scan thus falls silent by itself.

    spoken_s: time of the last entry of any source; minus infinity before the first.
    on_said, on_silenced: called with every entry (and its expiry), and with every one that was withdrawn.
    """

    def __init__(self, order: Sequence[Source], clock: Clock) -> None:
        self.order = tuple(order)
        self.on_said: Callable[[Word, float], None] = _forget
        self.on_silenced: Callable[[Source], None] = _forget
        self._clock = clock
        self._queue: PriorityQueue[Source, Word] = PriorityQueue(clock)
        self._spoken_at_s: dict[Source, float] = {}
        self.spoken_s = -math.inf

    def reorder(self, order: Sequence[Source]) -> None:
        """Change the priority order, also of the entries in force, and wake the mux."""
        if tuple(order) != self.order:
            self.order = tuple(order)
            self._queue.rank_anew(self.order.index)
            self._queue.poke()

    def say(self, word: Word, *, expires_at_s: float = NEVER_S) -> None:
        """Put an entry: it replaces the source's earlier one and wakes the mux."""
        self._spoken_at_s[word.source] = self.spoken_s = self._clock()
        self._queue.put(word.source, word, priority=self.order.index(word.source), expires_at_s=expires_at_s)
        self.on_said(word, expires_at_s)

    def silence(self, source: Source) -> None:
        """Withdraw an entry, for example of a latched e-stop that was reset."""
        self._queue.discard(source)
        self.on_silenced(source)
        self._queue.poke()

    def live(self) -> list[Word]:
        """Return the entries in force, most urgent first."""
        return self._queue.live()

    def word(self, source: Source) -> Word | None:
        """Return the entry of one source; None when it is silent."""
        return self._queue.peek(source)

    async def changed(self) -> None:
        """Wait for a new entry or a tick."""
        await self._queue.changed()

    def somebody_expired(self) -> bool:
        """Tell whether an entry has expired since the last `live`."""
        return self._queue.has_expired()

    def take_news(self) -> bool:
        """Tell whether `changed` would return at once, and clear its event, so that it waits for the next change."""
        return self._queue.take_news()

    def tick(self) -> None:
        """Wake the mux without a new entry: a mux that only forwards goes silent instead of stopping."""
        self._queue.poke()

    def ages_s(self) -> Mapping[Source, float]:
        """Return the age of each source's last entry; sources without any entry are missing."""
        now_s = self._clock()
        return {source: now_s - spoken_s for source, spoken_s in self._spoken_at_s.items()}


def _forget(*_: object) -> None:
    """Ignore the event."""
