"""Whether a car takes a planner's commands, by the car's own status. Pure: time is an argument.

A car drops what a certificate does not allow without an answer, so only its status can tell a planner that is heard
from one that is not. It counts what it accepted under every name, also without a permit and below a more urgent
planner.
"""

from collections.abc import Mapping
from typing import Any, Final

from wallride.runtime.teleop.rejections import Refusal

ACCEPTED_WITHIN_S: Final = 0.5
"""Time from the first command to a status that must show it accepted."""


class Acceptance:
    """Compares one status with the next.

    accepted: the car takes the commands. refused: why it does not, "" while that is not known.
    """

    def __init__(self, car: str, name: str) -> None:
        self._car = car
        self._name = name
        self._first: Mapping[str, Any] | None = None
        self._last: Mapping[str, Any] = {}
        self._sent_s: float | None = None
        self.accepted = False
        self.refused = ""

    @property
    def is_listed(self) -> bool:
        """Whether a status came that lists this planner."""
        return self._first is not None

    def begin(self, now_s: float) -> None:
        """Note the moment of the first command, in monotonic seconds."""
        self._sent_s = now_s

    def hear(self, status: Mapping[str, Any], now_s: float) -> None:
        """Take in a status that arrived at this moment, in monotonic seconds."""
        listed = dict((status.get("planners") or {}).get("planners") or {})
        if self._name not in listed:
            self.refused = self._not_listed(list(listed))
            return
        last, self._last = self._last, listed[self._name]
        if self._first is None or self._sent_s is None:
            self._first = self._last
            return
        rivals = _refused(self._last, Refusal.TOO_MANY) - _refused(last, Refusal.TOO_MANY)
        if self._last["accepted"] > last["accepted"] and not rivals:  # with a rival it is the rival's that count
            self.accepted = True
        elif now_s - self._sent_s >= ACCEPTED_WITHIN_S:
            self.refused = self._not_taken(self._first)

    def _not_listed(self, names: list[str]) -> str:
        if not names:
            return (
                f"{self._car} takes no planners: set planners.enabled = true and planners.names there, and restart it"
            )
        return (
            f"{self._car} lists no planner {self._name}; its planners.names: {', '.join(names)}."
            f" Use one of them, or add {self._name} there and restart the car"
        )

    def _not_taken(self, first: Mapping[str, Any]) -> str:
        kinds = {kind: _refused(self._last, kind) - _refused(first, kind) for kind in self._last["refused"]}
        grown = [f"{kind} ({count})" for kind, count in kinds.items() if count > 0]
        if kinds.get(Refusal.TOO_MANY, 0) > 0:
            return f"another program plans on {self._car} as {self._name}: end it, or give this one a name of its own"
        if grown:
            return f"{self._car} refuses the commands of planner {self._name}: {', '.join(grown)}"
        return (
            f"{self._car} heard no command of planner {self._name} for {ACCEPTED_WITHIN_S} s. Over tls it takes them"
            f" only with the certificate of {self._name} and the role planner: are your keys of another name or role?"
        )


def _refused(planner: Mapping[str, Any], kind: str) -> int:
    return int((planner.get("refused") or {}).get(kind, 0))
