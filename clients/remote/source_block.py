"""The `with` block in which a script commands a car: a session of its own, a steady rate, and an orderly end."""

import asyncio
import time
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
from types import TracebackType
from typing import Final, Self

from wallride.clients.remote.hand import ScriptedHand
from wallride.clients.remote.loop_thread import LoopThread
from wallride.runtime.ending import end
from wallride.runtime.wire.bus import Bus

PERIOD_S: Final = 0.02
READY_WITHIN_S: Final = 3.0
GOODBYES: Final = 3


class SourceRefusedError(Exception):
    """The car does not, or no longer, obey this script. reason: the text without what a script is to do."""

    def __init__(self, reason: str, then: str = "") -> None:
        super().__init__("; ".join(filter(None, (reason, then))))
        self.reason = reason


class SourceBlock(ABC):
    """A source of commands that a script holds. open_bus: opens a session of its own, which ends with the block.

    call: how the block is begun, for messages. refused: the error of a block that is not, or no longer, obeyed.
    """

    def __init__(
        self, thread: LoopThread, open_bus: Callable[[], Awaitable[Bus]], hand: ScriptedHand, call: str,
        refused: type[SourceRefusedError],
    ) -> None:  # fmt: skip
        self._thread = thread
        self._open_bus = open_bus
        self._hand = hand
        self._call = call
        self._refused = refused
        self._told = self._was_entered = False
        self._bus: Bus | None = None
        self._loop: asyncio.Task[None] | None = None

    def __enter__(self) -> Self:
        if self._was_entered:  # what it pressed and heard is of that time
            raise self._refused("a block is used once", f"begin anew with {self._call}")
        self._was_entered = True
        try:
            self._thread.call(self._begin(), begins=True)
        except BaseException:  # a Ctrl-C too: what has begun would keep the car
            if not self._thread.is_closed:
                self._thread.call(self._end(orderly=True))
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._thread.is_closed:  # that ended the block, as a lost source
            return
        self._thread.call(self._end(orderly=error is None and not self._hand.trouble))
        if self._told or not (why := self._unobeyed()):
            return
        if error is None:
            raise self._refused(why, f"begin anew with {self._call}")
        if self._hand.stopping:  # the other error must not hide that the car may drive on
            error.add_note(why)

    def send(self, speed_mps: float, steering_rad: float) -> None:
        """Ask for this drive for 0.2 s; the error of the block once the car no longer obeys this script."""
        self._check_begun()
        if self._hand.trouble:
            self._told = True
            raise self._refused(self._hand.trouble, f"begin anew with {self._call}")
        self._hand.send(speed_mps, steering_rad, time.monotonic())

    def release(self) -> None:
        """Ask for nothing; the next `send` drives again."""
        self._check_begun()
        self._hand.release()

    @abstractmethod
    async def _begin(self) -> None:
        """Open the session, and return once the car obeys."""

    @abstractmethod
    def _step(self, bus: Bus, now_s: float) -> None:
        """Send what is due; called every PERIOD_S."""

    @abstractmethod
    def _say_goodbye(self, bus: Bus, *, orderly: bool) -> None:
        """Send one goodbye; after an error or a stall one that is also a stop, and no release."""

    def _check_begun(self) -> None:
        self._thread.check_open()
        if self._bus is None:
            raise self._refused(f"use it in a with block: with {self._call} as source:")

    def _unobeyed(self) -> str:
        """Return why the car does not, or no longer, obey the block at its end, "" when it does."""
        return self._hand.trouble

    async def _run(self, bus: Bus) -> None:
        next_s = time.monotonic()
        while True:
            now_s = time.monotonic()
            self._step(bus, now_s)
            next_s = max(next_s + PERIOD_S, now_s)
            await asyncio.sleep(max(0.0, next_s - time.monotonic()))

    async def _end(self, *, orderly: bool) -> None:
        """Stop sending and give the place back; after an error or a stall the car stops as for a lost source."""
        loop, self._loop = self._loop, None
        bus, self._bus = self._bus, None
        if loop is not None:
            for error in await end(loop):
                raise error
        if bus is None:
            return
        try:
            for _ in range(GOODBYES):
                self._say_goodbye(bus, orderly=orderly)
                await asyncio.sleep(PERIOD_S)
        finally:
            await bus.close()
