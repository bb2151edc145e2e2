"""Recording on a timeline: messages due now, under pause, speed and seek. No clock, no bus."""

import math
from bisect import bisect_right
from collections.abc import Mapping
from typing import Any

from wallride.drivers.api import Clock
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.wire import topics
from wallride.sim.replay.drive_log import DriveLog, LoggedMessage

PLAYED = frozenset({*TYPES, *topics.JSON_TOPICS})
"""Topics of the telemetry; the decision log, settings and log lines of a recording are no topics."""
SLOWEST, FASTEST = 0.05, 50.0
MAX_STEP_S = 0.5
"""Maximum step; after a longer delay the player does not publish all missed messages at once."""
PAST_S = 10.0
"""Maximum age of a topic's message in the picture of a moment."""


class Player:
    """Plays the telemetry of a log. position_s: seconds since its first message."""

    def __init__(self, log: DriveLog, clock: Clock, *, speed: float = 1.0, loops: bool = False) -> None:
        played = [message for message in log.messages if message.topic in PLAYED]
        self._messages = sorted(played, key=lambda message: message.stamp_ns)
        zero_ns = self._messages[0].stamp_ns if self._messages else 0
        self._times_s = [(message.stamp_ns - zero_ns) / NS for message in self._messages]
        self._lasting = [at for at, message in enumerate(self._messages) if message.topic in topics.LASTING]
        self._clock = clock
        self._last_s = clock()
        self._next = 0
        self._jumped = False
        self.duration_s = self._times_s[-1] if self._times_s else 0.0
        self.position_s = 0.0
        self.speed = speed
        self.paused = False
        self.loops = loops

    @property
    def ended(self) -> bool:
        """Return whether everything was played."""
        return not self.loops and self.position_s >= self.duration_s

    def due(self) -> list[LoggedMessage]:
        """Return the messages to publish now, in order; after a jump the picture of that moment."""
        now_s = self._clock()
        elapsed_s, self._last_s = min(now_s - self._last_s, MAX_STEP_S), now_s
        if self._jumped:
            self._jumped = False
            return self.picture()
        if self.paused:
            return []
        self.position_s = min(self.position_s + elapsed_s * self.speed, self.duration_s)
        end = bisect_right(self._times_s, self.position_s)
        found, self._next = self._messages[self._next : end], end
        if self.loops and self.position_s >= self.duration_s:
            self.seek(0.0)
        return found

    def picture(self) -> list[LoggedMessage]:
        """Return the newest message of each topic at the position."""
        lasting = [at for at in self._lasting if at < self._next]
        newest = {self._messages[at].topic: self._messages[at] for at in lasting}
        for at in range(self._next - 1, -1, -1):
            if self._times_s[at] < self.position_s - PAST_S or len(newest) == len(PLAYED):
                break
            newest.setdefault(self._messages[at].topic, self._messages[at])
        return list(reversed(newest.values()))

    def seek(self, position_s: float) -> None:
        """Jump to a position, limited to the recording."""
        self.position_s = min(max(0.0, position_s), self.duration_s)
        self._next = bisect_right(self._times_s, self.position_s)
        self._jumped = True

    def multiply_speed(self, factor: float) -> None:
        """Multiply the speed of playing, within limits."""
        self.speed = min(max(self.speed * factor, SLOWEST), FASTEST)

    def handle_request(self, wish: object) -> None:
        """Process a request: {"pause": true}, {"speed": 2}, {"seek_s": 12}; ValueError with the remedy."""
        if not isinstance(wish, Mapping):
            raise ValueError('write an object, for example {"pause": true}')  # noqa: TRY004 - one kind of refusal
        unknown = wish.keys() - {"pause", "speed", "seek_s"}
        if unknown:
            raise ValueError(f'{", ".join(sorted(unknown))}: ask for "pause", "speed" or "seek_s"')
        pause, speed, seek_s = wish.get("pause"), wish.get("speed"), wish.get("seek_s")
        if pause is not None and not isinstance(pause, bool):
            raise ValueError('"pause" is true or false')
        if speed is not None and not (_is_number(speed) and SLOWEST <= speed <= FASTEST):
            raise ValueError(f'"speed" is a number from {SLOWEST:g} to {FASTEST:g}')
        if seek_s is not None and not _is_number(seek_s):
            raise ValueError('"seek_s" is a number of seconds')
        if seek_s is not None:
            self.seek(float(seek_s))
        self.speed = float(speed) if speed is not None else self.speed
        self.paused = pause if pause is not None else self.paused

    def status(self) -> dict[str, Any]:
        """Return the state of the player."""
        return {
            "position_s": round(self.position_s, 3),
            "duration_s": round(self.duration_s, 3),
            "speed": self.speed,
            "paused": self.paused,
        }


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and not math.isnan(value)
