"""History of setting changes: client, time, old and new value; the last few, in memory and as lines of JSON."""

import json
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields

from wallride.runtime.parameters.catalogue import Value


@dataclass(frozen=True, slots=True)
class SettingChange:
    """One setting that changed; old or new is None where a change of method added or removed the key.

    stamp_s: on the car's monotonic clock. at: date and time in UTC, for people; nothing is computed from it.
    by: the name that the client gave itself.
    """

    stamp_s: float
    at: str
    by: str
    name: str
    old: Value | None
    new: Value | None


class ChangeHistory:
    """The newest `most` changes, oldest first.

    notify: called after every addition, so that it is written to the file.
    """

    def __init__(self, most: int) -> None:
        self._changes: deque[SettingChange] = deque(maxlen=most)
        self.added = 0
        self.notify: Callable[[], None] = _ignore

    def add(self, changes: Sequence[SettingChange]) -> None:
        """Add changes; the oldest beyond the bound are forgotten."""
        if changes:
            self._changes.extend(changes)
            self.added += len(changes)
            self.notify()

    def newest(self, count: int) -> list[SettingChange]:
        """Return at most `count` of the newest, oldest first."""
        return list(self._changes)[-count:] if count > 0 else []

    def lines(self) -> str:
        """Return everything as JSON, one line a change."""
        return "".join(f"{json.dumps(asdict(change))}\n" for change in self._changes)

    def read(self, lines: Iterable[str]) -> int:
        """Load lines written earlier; return the number of unreadable ones, which are left out."""
        bad = 0
        for line in lines:
            try:
                entry = json.loads(line)
                self._changes.append(
                    SettingChange(**{field.name: entry[field.name] for field in fields(SettingChange)})
                )
            except (ValueError, TypeError, KeyError, RecursionError):
                bad += 1
        return bad


def _ignore() -> None:
    """Ignore the notification."""
