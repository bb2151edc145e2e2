"""What is remembered in case of a stop, and what counts as one."""

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from runtime.arbitration.command import Output, Source, SpeedLimit
from runtime.recording.channels import RecordMessage
from runtime.recording.decision_log import Heard

NS = 1_000_000_000
MAX_BYTES = 24_000_000
MOVING_MPS = 0.2
"""A stop from less than this is a car that came to rest by itself."""
LASTING_S = 0.1
"""A stop that is over sooner is a hesitation."""
LOST = "lost"
"""An operator who lets go is no event; one who was lost is."""


class BufferedMessage(NamedTuple):
    """A message and its running number."""

    number: int
    message: RecordMessage


class Memory:
    """The newest messages, bounded in time and in bytes."""

    def __init__(self, longest_s: float, most_bytes: int = MAX_BYTES) -> None:
        self._longest_ns = round(longest_s * NS)
        self._most_bytes = most_bytes
        self._kept: deque[BufferedMessage] = deque()
        self._basis: dict[str, RecordMessage] = {}
        self._bytes = 0
        self._next = 0

    @property
    def next_number(self) -> int:
        """The number of the message that comes next."""
        return self._next

    def add(self, message: RecordMessage) -> None:
        """Remember a message, and forget what is too old for it."""
        self._kept.append(BufferedMessage(self._next, message))
        self._next += 1
        self._bytes += len(message.payload)
        oldest_ns = message.stamp_ns - self._longest_ns
        while self._kept and (self._kept[0].message.stamp_ns < oldest_ns or self._bytes > self._most_bytes):
            forgotten = self._kept.popleft().message
            self._bytes -= len(forgotten.payload)
            if forgotten.lasting:
                self._basis[forgotten.topic] = forgotten

    def since(self, number: int) -> Iterator[RecordMessage]:
        """Yield what a file needs that begins with a message: what lasts from before it, then all from it on."""
        earlier = [kept.message for kept in self._kept if kept.number < number]
        wanted = [kept.message for kept in self._kept if kept.number >= number]
        lasting = self._basis | {message.topic: message for message in earlier if message.lasting}
        begin = next(iter((*wanted[:1], *earlier[-1:])), None)
        for message in lasting.values():
            yield message._replace(stamp_ns=begin.stamp_ns) if begin is not None else message
        yield from wanted


class StopWatcher:
    """Tells which stops are worth a black box: an e-stop at once, another one when it was from a drive and lasts.

    Those are: safety that brakes, a driver without a word from those who must agree, an operator who was lost, and a
    motor that takes no commands.
    """

    def __init__(self) -> None:
        self._held = False
        self._moving = False
        self._driver: Source | None = None
        self._stopped: tuple[float, str] | None = None

    def look(self, output: Output, live: Heard) -> str | None:
        """Take in one decision; returns the reason of a stop that has just become one."""
        held = next((word for word in live if isinstance(word, SpeedLimit) and word.source is Source.ESTOP), None)
        begins, self._held = held is not None and not self._held, held is not None
        if begins and held is not None:
            self._moving, self._stopped = False, None
            return held.outlook.limit(0.0, 0.0).reason
        if output.delivered and abs(output.drive.speed_mps) >= MOVING_MPS:
            self._moving, self._stopped, self._driver = True, None, output.decision.driver
        elif self._moving and (reason := self._reason(output)) is not None:
            self._moving, self._stopped = False, (output.stamp_s, reason)
        else:
            self._moving = False
            if output.delivered and output.drive.speed_mps:
                self._stopped = None
        if self._stopped is not None and output.stamp_s - self._stopped[0] >= LASTING_S:
            (_, reason), self._stopped = self._stopped, None
            return reason
        return None

    def _reason(self, output: Output) -> str | None:
        """Return why a moving car is to stand now; None when it is not, or when the operator let go."""
        decision = output.decision
        if not output.delivered:
            return "the motor takes no commands"
        if output.drive.speed_mps:
            return None
        if decision.winner is Source.SAFETY or LOST in decision.reason:
            return decision.reason
        if decision.winner is not None:
            return None
        if decision.driver is not None:
            return decision.reason
        return "no word from navigation" if self._driver is Source.NAVIGATION else None
