"""Driving from a script: an operator's session of its own, with token, heartbeat's echo, deadman and goodbye."""

import asyncio
import secrets
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from types import TracebackType
from typing import Final, Self

from clients.connection import ConnectionProblemError
from clients.remote.hand import ScriptedHand
from clients.remote.loop_thread import LoopThread
from clients.teleop.pilot import Pilot
from runtime.wire import topics
from runtime.wire.bus import Bus
from runtime.wire.network import BYTES
from runtime.wire.teleop import Input, Malformed, read_beat

PERIOD_S: Final = 0.02
READY_WITHIN_S: Final = 3.0
LAST_WORDS: Final = 3


class DriveRefusedError(Exception):
    """The car does not, or no longer, obey this script; the text is the reason."""


class RemoteDriver:
    """`with car.drive() as hand: hand.send(1.0, 0.1)`; to be sent again within 0.2 s, or the car stops.

    open_bus: opens a session of its own, which ends with the block. name: shown by the car.
    """

    def __init__(
        self, thread: LoopThread, open_bus: Callable[[], Awaitable[Bus]], car: str, name: str, hand: ScriptedHand
    ) -> None:
        self._thread = thread
        self._open_bus = open_bus
        self._car = car
        self._hand = hand
        self._pilot = Pilot(secrets.randbits(63) + 1, name, hand.shape)
        self._bus: Bus | None = None
        self._loop: asyncio.Task[None] | None = None
        self._ready = asyncio.Event()

    def __enter__(self) -> Self:
        self._thread.call(self._begin())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._thread.call(self._end(orderly=error is None and not self._hand.trouble))

    def send(self, speed_mps: float, steering_rad: float) -> None:
        """Hold this drive for 0.2 s; DriveRefusedError once the car took the deadman from this script."""
        if self._bus is None:
            raise DriveRefusedError("use it in a with block: with car.drive() as hand:")
        if self._hand.trouble:
            raise DriveRefusedError(f"{self._hand.trouble}; begin anew with car.drive()")
        self._hand.send(speed_mps, steering_rad, time.monotonic())

    def release(self) -> None:
        """Let go: the car stops, unless it may drive by itself. The next `send` drives again."""
        self._hand.release()

    def e_stop(self) -> None:
        """Press the e-stop; it stays latched until an operator resets it."""
        self._hand.press_e_stop()

    async def _begin(self) -> None:
        self._bus = bus = await self._open_bus()
        bus.subscribe(topics.key(self._car, topics.BEAT), self._on_beat)
        bus.announce(topics.key(self._car, f"{topics.OPERATOR_ALIVE}/{self._pilot.session:016x}"))
        self._loop = asyncio.create_task(self._run(bus), name="drive")
        try:
            async with asyncio.timeout(READY_WITHIN_S):
                await self._ready.wait()
        except TimeoutError:
            block = self._pilot.situation.block if self._pilot.situation is not None else ""
            await self._end(orderly=True)
            raise DriveRefusedError(f"{self._car} cannot be driven now: {block or 'no answer'}") from None

    async def _run(self, bus: Bus) -> None:
        next_s = time.monotonic()
        while True:
            now_s = time.monotonic()
            self._send(bus, self._pilot.step(self._hand.inputs(now_s), now_s).pack())
            if (state := self._pilot.situation) is not None:
                self._hand.note(state)
                if state.armed:
                    self._ready.set()
            next_s = max(next_s + PERIOD_S, now_s)
            await asyncio.sleep(max(0.0, next_s - time.monotonic()))

    async def _end(self, *, orderly: bool) -> None:
        """Say goodbye, or after an error fall silent: a lost operator, for whom nothing drives on."""
        loop, self._loop = self._loop, None
        bus, self._bus = self._bus, None
        if loop is not None:
            loop.cancel()
            with suppress(asyncio.CancelledError):
                await loop
        if bus is None:
            return
        try:
            for _ in range(LAST_WORDS if orderly else 0):
                self._send(bus, self._pilot.goodbye(Input.SCRIPT).pack())
                await asyncio.sleep(PERIOD_S)
        finally:
            await bus.close()

    def _send(self, bus: Bus, payload: bytes) -> None:
        bus.put(topics.key(self._car, topics.COMMAND), payload, encoding=BYTES, urgent=True)

    def _on_beat(self, _key: str, payload: bytes, arrival_s: float) -> None:
        with suppress(Malformed):
            self._pilot.hear(read_beat(payload), arrival_s)


def checked_hand(max_speed_mps: float, max_steering_rad: float) -> ScriptedHand:
    """Return a hand; ConnectionProblemError for limits that are none."""
    try:
        return ScriptedHand(max_speed_mps, max_steering_rad)
    except ValueError as error:
        raise ConnectionProblemError(str(error)) from None
