"""Delay line: each value takes effect a fixed time after it was put in."""

from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")

_ROUNDING_S = 1e-9


class DelayLine(Generic[T]):
    """Returns each value `delay_s` after it was put in; before the first one is due, the value at rest."""

    def __init__(self, delay_s: float, at_rest: T) -> None:
        self.delay_s = delay_s
        self._now = at_rest
        self._last = at_rest
        self._coming: deque[tuple[float, T]] = deque()

    def put(self, now_s: float, value: T) -> None:
        """Put in a value; times must not run backwards."""
        if value != self._last:
            self._coming.append((now_s + self.delay_s, value))
            self._last = value

    def at(self, now_s: float) -> T:
        """Return the value in effect."""
        while self._coming and self._coming[0][0] <= now_s + _ROUNDING_S:
            self._now = self._coming.popleft()[1]
        return self._now
