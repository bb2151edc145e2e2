"""Rejected commands: counted by kind, and logged at a limited rate."""

from collections.abc import Mapping
from enum import StrEnum

from wallride.runtime.host.rate_limited_log import RateLimitedLog


class Refusal(StrEnum):
    """Reasons for which a command is not obeyed; the values are the names in the status."""

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
    UNCOMPARED = "clock not compared yet"
    OTHER_TYPE = "another message type"


class Refusals:
    """Counts rejections; the log gets one line per kind and second at most, at any rate of arrival."""

    def __init__(self, log: RateLimitedLog) -> None:
        self._log = log
        self._counts: dict[Refusal, int] = {}

    @property
    def counts(self) -> Mapping[str, int]:
        """Count of each kind since the start; kinds that never occurred are missing."""
        return {str(kind): count for kind, count in self._counts.items()}

    def count(self, kind: Refusal, detail: str) -> None:
        """Count one; `detail` is this program's own text, never quoted from the payload."""
        self._counts[kind] = self._counts.get(kind, 0) + 1
        self._log.log(kind, f"command not obeyed, {kind}: {detail}")
