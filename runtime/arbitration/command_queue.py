"""The command queue: every voice has one slot, ordered as the mux obeys them, each word with its expiry."""

import math
from collections.abc import Callable, Mapping, Sequence

from drivers.api import Clock
from runtime.arbitration.command import Source, Word
from runtime.arbitration.queues import NEVER_S, PriorityQueue


class CommandQueue:
    """Where tasks speak and the mux listens.

    A word expires by its measurement, not by its delivery: the source passes the time at which its oldest input
    stops being true. A task that keeps running on a frozen scan thus falls silent by itself.

    spoken_s: when anybody spoke last; minus infinity before that.
    on_said, on_silenced: told of every word (with its expiry) and of every one that was withdrawn.
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
        """Change who outranks whom, for the words in force as well, and wake the mux."""
        if tuple(order) != self.order:
            self.order = tuple(order)
            self._queue.rank_anew(self.order.index)
            self._queue.poke()

    def say(self, word: Word, *, expires_at_s: float = NEVER_S) -> None:
        """Speak: this replaces the source's earlier word and wakes the mux."""
        self._spoken_at_s[word.source] = self.spoken_s = self._clock()
        self._queue.put(word.source, word, priority=self.order.index(word.source), expires_at_s=expires_at_s)
        self.on_said(word, expires_at_s)

    def silence(self, source: Source) -> None:
        """Withdraw a word, for example a latched e-stop that was reset."""
        self._queue.discard(source)
        self.on_silenced(source)
        self._queue.poke()

    def live(self) -> list[Word]:
        """Return the words in force, most urgent first."""
        return self._queue.live()

    def word(self, source: Source) -> Word | None:
        """Return the word of one voice; None when it is silent."""
        return self._queue.peek(source)

    async def changed(self) -> None:
        """Wait for a new word or a tick."""
        await self._queue.changed()

    def somebody_expired(self) -> bool:
        """Tell whether a word has expired since the last `live`."""
        return self._queue.has_expired()

    def take_news(self) -> bool:
        """Tell whether `changed` would return at once, and have it wait for the next news instead."""
        return self._queue.take_news()

    def tick(self) -> None:
        """Wake the mux without a new word: a mux that only forwards goes silent instead of stopping."""
        self._queue.poke()

    def ages_s(self) -> Mapping[Source, float]:
        """Return how long ago each voice spoke last; voices that never spoke are missing."""
        now_s = self._clock()
        return {source: now_s - spoken_s for source, spoken_s in self._spoken_at_s.items()}


def _forget(*_: object) -> None:
    """Write nothing down."""
