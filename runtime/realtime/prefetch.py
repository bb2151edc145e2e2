"""Prefetch of the code and data that the answer to a scan needs, shortly before the scan is due.

Between two scans the car's process sleeps for 20 ms, and other processes evict its data from the caches. Afterwards
each access waits for memory: of 0.45 ms from scan to motor, 0.3 ms are such cache misses. All lines requested at once
arrive in a hundredth of a millisecond. The prefetch is a hint to the processor: nothing is run, read or changed by it.

The set is learnt by tracing one answer now and then, from the moment before the scan to its last step: the code that
runs, its functions and classes, and the objects that are present at every answer.
"""

import sys
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Final

from runtime.realtime.cache_lines import Addresses, Call, addresses, called, held

Prefetch = Callable[[Addresses], object]
"""Fetches the cache lines at these addresses, (n,), without waiting for them."""

WATCHED_EVERY: Final = 1000
"""Maximum number of answers between two traced ones, because the car may do something new; at first much oftener: the
first, the second, the fourth, the eighth. A traced answer takes a third longer."""


class Warmth:
    """Learns and prefetches: call `warm` shortly before a scan, and `answered` when the motor has its command.

    prefetch: None where no prefetch is possible; then nothing is done at all. known: the code that answers need.
    lasting: the objects whose methods they call, as far as present at two traced answers in a row.
    """

    def __init__(self, prefetch: Prefetch | None = None) -> None:
        self.known: set[CodeType] = set()
        self.lasting: dict[int, object] = {}
        self._prefetch = prefetch
        self._lines = addresses(())
        self._needed: dict[int, object] = {}  # by every call of `known`
        self._owners: dict[int, object] = {}  # of the last traced answer
        self._warmed = 0
        self._calls: list[Call] | None = None  # while an answer is traced

    def warm(self) -> None:
        """Prefetch the known set, and start a trace now and then."""
        if self._prefetch is None:
            return
        self._prefetch(self._lines)
        self._warmed += 1
        if self._calls is not None:  # no scan came: the trace holds something else
            self.stop()
        elif self._is_due() and sys.getprofile() is None:
            self._calls = []
            sys.setprofile(self._see)

    def answered(self) -> None:
        """Learn from the traced answer, if there is one."""
        if self._calls is None:
            return
        calls = self._calls
        self.stop()
        new = [call for call in calls if call.code not in self.known]
        self.known.update(call.code for call in new)
        self._needed.update((id(thing), thing) for call in new for thing in called(call))
        owners = {id(call.owner): call.owner for call in calls if call.owner is not None}
        lasting = {at: owner for at, owner in owners.items() if at in self._owners}
        self._owners = owners
        if new or lasting.keys() != self.lasting.keys():
            self.lasting = lasting
            self._lines = addresses([*self._needed.values(), *(x for one in self.lasting.values() for x in held(one))])

    def stop(self) -> None:
        """Stop a trace; harmless when repeated."""
        if self._calls is not None:
            self._calls = None
            sys.setprofile(None)

    def _is_due(self) -> bool:
        is_power_of_two = self._warmed & (self._warmed - 1) == 0
        return is_power_of_two or self._warmed % WATCHED_EVERY == 0

    def _see(self, frame: FrameType, event: str, _: object) -> None:
        if event == "call" and self._calls is not None:
            self._calls.append(Call(frame.f_code, frame.f_globals, frame.f_locals.get("self")))
