"""The memory of the newest messages for black boxes, and the detection of the stops that deserve one."""

import mmap
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from wallride.runtime.arbitration.command import Output, Source, SpeedLimit
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.recording.channels import RecordMessage
from wallride.runtime.recording.decision_log import Heard

MAX_BYTES = 24_000_000
BLOCK_B = 256 << 10
"""Length of a block of remembered bytes, a second of a drive; the shortest that is worth a call of the system."""
MOVING_MPS = 0.2
"""Minimum speed before a stop; from less the car came to rest by itself."""
LASTING_S = 0.1
"""Minimum duration of a stop; a shorter one is a hesitation."""
LOST = "lost"
"""The state of a lost operator: its stop is an event, the stop after a release is none."""


class BufferedMessage(NamedTuple):
    """A message and its running number."""

    number: int
    message: RecordMessage


class Memory:
    """The newest messages, bounded in time and in bytes.

    Their bytes are copied into blocks of their own, used again when their last message is dropped: beside thousands of
    objects of all sizes the allocator would keep holes, and the process would grow for a quarter of an hour. A message
    is valid until the next `add`. next_number: of the message that is added next.
    """

    def __init__(self, longest_s: float, most_bytes: int = MAX_BYTES) -> None:
        self._longest_ns = round(longest_s * NS)
        self._most_bytes = most_bytes
        self._kept: deque[BufferedMessage] = deque()
        self._basis: dict[str, RecordMessage] = {}
        self._bytes = 0
        self.next_number = 0
        self._block, self._used = memoryview(bytearray()), 0
        self._full: deque[tuple[memoryview, int]] = deque()  # with the number of the first message after it
        self._free: list[memoryview] = []

    def add(self, message: RecordMessage) -> None:
        """Add a message, and drop those that are too old."""
        self._kept.append(BufferedMessage(self.next_number, message._replace(payload=self._store(message.payload))))
        self.next_number += 1
        self._bytes += len(message.payload)
        oldest_ns = message.stamp_ns - self._longest_ns
        while self._kept and (self._kept[0].message.stamp_ns < oldest_ns or self._bytes > self._most_bytes):
            forgotten = self._kept.popleft().message
            self._bytes -= len(forgotten.payload)
            if forgotten.lasting:
                self._basis[forgotten.topic] = forgotten._replace(payload=bytes(forgotten.payload))
        oldest = self._kept[0].number if self._kept else self.next_number
        while self._full and self._full[0][1] <= oldest:
            self._free.append(self._full.popleft()[0])

    def _store(self, payload: bytes | memoryview) -> memoryview:
        size = len(payload)
        if self._used + size > len(self._block):
            self._full.append((self._block, self.next_number))
            self._block, self._used = self._another(size), 0
        part = self._block[self._used : self._used + size]
        part[:] = payload
        self._used += size
        return part.toreadonly()

    def _another(self, size: int) -> memoryview:
        while self._free:
            block = self._free.pop()
            if len(block) >= size:
                return block
        return memoryview(mmap.mmap(-1, max(BLOCK_B, size)))

    def holds(self, number: int) -> bool:
        """Tell whether all messages from a number on are still remembered."""
        return number >= (self._kept[0].number if self._kept else self.next_number)

    def after(self, number: int) -> list[RecordMessage]:
        """Return the messages from a number on."""
        return [kept.message for kept in self._kept if kept.number >= number]

    def since(self, number: int) -> Iterator[RecordMessage]:
        """Yield the content of a file that begins with a message: lasting ones from before it, then all from it on."""
        earlier = [kept.message for kept in self._kept if kept.number < number]
        wanted = self.after(number)
        lasting = self._basis | {message.topic: message for message in earlier if message.lasting}
        begin = next(iter((*wanted[:1], *earlier[-1:])), None)
        for message in lasting.values():
            yield message._replace(stamp_ns=begin.stamp_ns) if begin is not None else message
        yield from wanted


class StopWatcher:
    """Selects the stops worth a black box: an e-stop at once, another one if it ends a drive and lasts.

    Such stops are: braking by safety, the silence of a required source, a lost operator, and a motor that takes no
    commands.
    """

    def __init__(self) -> None:
        self._held = False
        self._moving = False
        self._driver: Source | None = None
        self._stopped: tuple[float, str] | None = None

    def look(self, output: Output, live: Heard) -> str | None:
        """Take in one decision; return the reason of a stop that has just qualified."""
        held = next((word for word in live if isinstance(word, SpeedLimit) and word.source is Source.ESTOP), None)
        begins, self._held = held is not None and not self._held, held is not None
        if begins and held is not None:
            self._moving, self._stopped = False, None
            return held.assessment.ask(0.0, 0.0).reason
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
        """Return why a moving car is to stop now; None when it is not, or when the operator released."""
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
