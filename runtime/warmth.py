"""Has the processor fetch the code of a scan's answer shortly before the scan comes.

Between two scans the car sleeps for 20 ms, and others empty the processor's caches. What runs next comes from memory
piece by piece, each waited for: of 0.45 ms from scan to motor, 0.3 ms are that. All pieces asked for at once come in
a hundredth of a millisecond. It is a hint to the processor: nothing is run, read or changed by it.

Which code that is, is seen by watching one answer now and then, from the moment before the scan to its last step.
"""

import sys
from collections.abc import Callable, Iterable, Iterator
from types import CodeType, FrameType
from typing import Final

import numpy as np
import numpy.typing as npt

Addresses = npt.NDArray[np.intp]
Prefetch = Callable[[Addresses], object]
"""Fetches the cache lines at these addresses, (n,), without waiting for them."""

LINE_BYTES: Final = 64
WATCHED_EVERY: Final = 1000
"""So many answers apart one is watched, because the car may do what it did not do before; at first much oftener: the
first, the second, the fourth, the eighth. A watched answer takes a third longer."""
LONGEST_TEXT_BYTES: Final = 256
"""What is longer is a docstring."""


class Warmth:
    """Call `warm` when a scan is due in a moment, and `answered` when the motor has its command.

    prefetch: None where nothing can be fetched; then nothing is done at all. known: the code that answers need.
    """

    def __init__(self, prefetch: Prefetch | None = None) -> None:
        self.known: set[CodeType] = set()
        self._prefetch = prefetch
        self._lines = addresses(())
        self._warmed = 0
        self._seen: set[CodeType] | None = None  # while an answer is watched

    def warm(self) -> None:
        """Fetch what is known, and now and then watch what is needed."""
        if self._prefetch is None:
            return
        self._prefetch(self._lines)
        self._warmed += 1
        if self._seen is not None:  # no scan came: what was seen is something else
            self.stop()
        elif self._is_due() and sys.getprofile() is None:
            self._seen = set()
            sys.setprofile(self._see)

    def answered(self) -> None:
        """Learn from the answer that was watched, if it was."""
        if self._seen is None:
            return
        seen = self._seen
        self.stop()
        if not seen <= self.known:
            self.known |= seen
            self._lines = addresses(self.known)

    def stop(self) -> None:
        """Watch nothing; harmless when repeated."""
        if self._seen is not None:
            self._seen = None
            sys.setprofile(None)

    def _is_due(self) -> bool:
        is_power_of_two = self._warmed & (self._warmed - 1) == 0
        return is_power_of_two or self._warmed % WATCHED_EVERY == 0

    def _see(self, frame: FrameType, event: str, _: object) -> None:
        if event == "call" and self._seen is not None:
            self._seen.add(frame.f_code)


def addresses(codes: Iterable[CodeType]) -> Addresses:
    """Return where the cache lines of these codes are, with the names and constants that they mention."""
    mentioned = {id(thing): thing for code in codes for thing in _mentioned(code)}
    lines = {
        line
        for start, thing in mentioned.items()
        for line in range(start // LINE_BYTES, (start + thing.__sizeof__() - 1) // LINE_BYTES + 1)
    }
    return np.array(sorted(lines), np.intp) * LINE_BYTES


def _mentioned(code: CodeType) -> Iterator[object]:
    yield code
    yield code.co_consts
    yield code.co_names
    yield from code.co_names
    yield from (thing for thing in code.co_consts if thing.__sizeof__() <= LONGEST_TEXT_BYTES)
