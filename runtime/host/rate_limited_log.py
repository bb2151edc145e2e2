"""A log for events that outside clients can cause at any rate: a few lines, and the number of suppressed ones."""

import logging
from dataclasses import dataclass

from wallride.drivers.api import Clock

FIRST_PAUSE_S = 1.0
MAX_PAUSE_S = 60.0


@dataclass(slots=True)
class _Kind:
    due_s: float
    pause_s: float
    withheld: int


class RateLimitedLog:
    """Logs each kind of event at most once a second; a persistent one ever more rarely, up to once a minute.

    The kinds must be few and defined by this program, since each is remembered.
    """

    def __init__(self, log: logging.Logger, clock: Clock) -> None:
        self._log = log
        self._clock = clock
        self._kinds: dict[str, _Kind] = {}

    def log(self, kind: str, text: str, level: int = logging.WARNING) -> None:
        """Log the event, or only count it."""
        now_s = self._clock()
        known = self._kinds.setdefault(kind, _Kind(now_s, FIRST_PAUSE_S, 0))
        if now_s < known.due_s:
            known.withheld += 1
            return
        more = f" (and {known.withheld} more)" if known.withheld else ""
        known.pause_s = min(known.pause_s * 2, MAX_PAUSE_S) if known.withheld else FIRST_PAUSE_S
        known.due_s = now_s + known.pause_s
        known.withheld = 0
        self._log.log(level, "%s%s", text, more)
