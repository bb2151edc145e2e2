"""Commands that were not obeyed: counted by kind, and said in the log now and then."""

from collections.abc import Mapping
from enum import StrEnum

from runtime.host.rate_limited_log import RateLimitedLog


class Refusal(StrEnum):
    """Why a command was not obeyed; the values are the names in the status."""

    MALFORMED = "malformed"
    FOREIGN = "for another start of the car"
    UNKNOWN_BEAT = "unknown beat"
    STALE = "stale"
    REPLAY = "replay"
    OVER = "session is over"
    TOO_MANY = "too many sessions"
    NOT_OPERATOR = "not the operator"
    REARM = "not released yet"
    HELD = "e-stop is latched"
    FROZEN = "the pad is frozen"
    UNSURE = "no input from the operator"
    CONTRADICTION = "contradicting buttons"


class Refusals:
    """Counts; the log hears of each kind at most once a second, whatever arrives."""

    def __init__(self, log: RateLimitedLog) -> None:
        self._log = log
        self._counts: dict[Refusal, int] = {}

    @property
    def counts(self) -> Mapping[str, int]:
        """How often each kind happened since the start; kinds that never did are missing."""
        return {str(kind): count for kind, count in self._counts.items()}

    def count(self, kind: Refusal, detail: str) -> None:
        """Remember one; `detail` is in our own words, never quoted from what came."""
        self._counts[kind] = self._counts.get(kind, 0) + 1
        self._log.say(kind, f"command not obeyed, {kind}: {detail}")
