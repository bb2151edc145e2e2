"""The expiring priority queue that connects the tasks, and its variant with a single slot.

`asyncio.PriorityQueue` is wrong for a car in three ways: its head is the most urgent entry *ever*, so a joystick
command from before a radio drop-out wins; two entries of one source pile up, so the car replays the past; and `get()`
consumes what the mux needs again at its next tick. Here every source has one slot, every entry expires, and reading
takes nothing: `live()` returns the entries in force, `sweep()` drops the expired ones as well.

Entries lost by design: one that a newer one of the same source replaced, and one that expired unread. For one loop
only; other threads enter through `loop.call_soon_threadsafe`.
"""

import asyncio
from bisect import insort
from collections.abc import Callable, Hashable
from itertools import count
from typing import Generic, TypeVar

from wallride.drivers.api import Clock

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")

NEVER_S = float("inf")
"""Expiry of entries that hold until they are replaced or withdrawn, such as a latched e-stop."""


class PriorityQueue(Generic[K, V]):
    """One slot per key, ordered by priority (smaller is more urgent), then by age (older first).

    The order is a sorted list of the occupied slots rather than a heap: a replaced entry leaves at once, so nothing
    superseded can pile up and nothing needs compacting, and `live()` is one pass over the list. With a handful of keys
    it is also faster; docs/decisions/0003-priority-queue.md has the argument.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        # Entries: priority, then age, which together are unique, so that no more is compared; key, value, expiry.
        self._slots: dict[K, tuple[int, int, K, V, float]] = {}
        self._order: list[tuple[int, int, K, V, float]] = []
        self._ages = count()
        self._change = asyncio.Event()

    def __len__(self) -> int:
        return len(self._slots)

    def place(self, key: K, value: V, *, priority: int, expires_at_s: float) -> None:
        """Put an entry into its slot; it replaces the earlier one of the same key and counts as a change."""
        slots, order = self._slots, self._order
        if key in slots:
            order.remove(slots[key])
        slots[key] = entry = (priority, next(self._ages), key, value, expires_at_s)
        insort(order, entry)
        self._change.set()

    def discard(self, key: K) -> None:
        """Withdraw the entry of a key; harmless when there is none."""
        entry = self._slots.pop(key, None)
        if entry is not None:
            self._order.remove(entry)

    def change_priorities(self, priority: Callable[[K], int]) -> None:
        """Change the priorities of the entries; their content, age and expiry stay."""
        for key, (_, age, _, value, expires_at_s) in self._slots.items():
            self._slots[key] = (priority(key), age, key, value, expires_at_s)
        self._order = sorted(self._slots.values())

    def live(self) -> list[V]:
        """Return all entries in force now, most urgent first, and change nothing."""
        now_s = self._clock()
        return [value for _, _, _, value, expires_at_s in self._order if expires_at_s > now_s]

    def sweep(self) -> list[V]:
        """Drop what has expired, and return all entries in force now, most urgent first."""
        now_s = self._clock()
        for _, _, key, _, expires_at_s in self._order[:]:
            if expires_at_s <= now_s:
                self.discard(key)
        return [value for _, _, _, value, _ in self._order]

    def entry(self, key: K) -> V | None:
        """Return the entry of a key without removing it, None when it is not in force now."""
        entry = self._slots.get(key)
        return entry[3] if entry is not None and entry[4] > self._clock() else None

    async def changed(self) -> None:
        """Wait until an entry was put, or `tick` was called, since this last returned or the event was cleared."""
        while not self._change.is_set():  # woken, but another reader was quicker
            await self._change.wait()
        self._change.clear()

    def has_expired(self) -> bool:
        """Tell whether an entry has expired that `sweep` has not dropped yet."""
        now_s = self._clock()
        return any(expires_at_s <= now_s for *_, expires_at_s in self._order)

    def take_change(self) -> bool:
        """Tell whether the change event is set, and clear it."""
        change = self._change.is_set()
        self._change.clear()
        return change

    def tick(self) -> None:
        """Wake the waiter in `changed` without a new entry, so that silence is examined as well as changes."""
        self._change.set()
