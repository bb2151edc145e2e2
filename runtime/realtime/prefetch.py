"""Has the processor fetch what the answer to a scan needs shortly before the scan comes.

Between two scans the car sleeps for 20 ms, and others empty the processor's caches. What runs next comes from memory
piece by piece, each waited for: of 0.45 ms from scan to motor, 0.3 ms are that. All pieces asked for at once come in
a hundredth of a millisecond. It is a hint to the processor: nothing is run, read or changed by it.

What that is, is seen by watching one answer now and then, from the moment before the scan to its last step: the code
that runs, its functions and classes, and the objects that are there at every answer.
"""

import sys
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Final

from runtime.realtime.cache_lines import Addresses, Call, addresses, called, held

Prefetch = Callable[[Addresses], object]
"""Fetches the cache lines at these addresses, (n,), without waiting for them."""

WATCHED_EVERY: Final = 1000
"""So many answers apart one is watched, because the car may do what it did not do before; at first much oftener: the
first, the second, the fourth, the eighth. A watched answer takes a third longer."""


class Warmth:
    """Call `warm` when a scan is due in a moment, and `answered` when the motor has its command.

    prefetch: None where nothing can be fetched; then nothing is done at all. known: the code that answers need.
    lasting: the objects whose methods they call, of those that were there at two watched answers in a row.
    """

    def __init__(self, prefetch: Prefetch | None = None) -> None:
        self.known: set[CodeType] = set()
        self.lasting: dict[int, object] = {}
        self._prefetch = prefetch
        self._lines = addresses(())
        self._needed: dict[int, object] = {}  # by every call of what is known
        self._owners: dict[int, object] = {}  # of the last answer that was watched
        self._warmed = 0
        self._calls: list[Call] | None = None  # while an answer is watched

    def warm(self) -> None:
        """Fetch what is known, and now and then watch what is needed."""
        if self._prefetch is None:
            return
        self._prefetch(self._lines)
        self._warmed += 1
        if self._calls is not None:  # no scan came: what was seen is something else
            self.stop()
        elif self._is_due() and sys.getprofile() is None:
            self._calls = []
            sys.setprofile(self._see)

    def answered(self) -> None:
        """Learn from the answer that was watched, if it was."""
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
        """Watch nothing; harmless when repeated."""
        if self._calls is not None:
            self._calls = None
            sys.setprofile(None)

    def _is_due(self) -> bool:
        is_power_of_two = self._warmed & (self._warmed - 1) == 0
        return is_power_of_two or self._warmed % WATCHED_EVERY == 0

    def _see(self, frame: FrameType, event: str, _: object) -> None:
        if event == "call" and self._calls is not None:
            self._calls.append(Call(frame.f_code, frame.f_globals, frame.f_locals.get("self")))
