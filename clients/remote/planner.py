"""Planning from a script: a navigation source of its own on the car, under safety and permit."""

import asyncio
import secrets
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from types import TracebackType
from typing import Final, Self

from clients.remote.hand import ScriptedHand
from clients.remote.loop_thread import LoopThread
from clients.teleop.inputs import Inputs
from runtime.wire import topics
from runtime.wire.bus import Bus
from runtime.wire.network import BYTES
from runtime.wire.teleop import Beat, Command, Input, Malformed, Press, read_beat

PERIOD_S: Final = 0.02
READY_WITHIN_S: Final = 3.0
GOODBYES: Final = 3


class PlanRefusedError(Exception):
    """The car does not, or no longer, hear this planner; the text is the reason."""


class RemotePlanner:
    """`with car.plan("slam") as plan: plan.send(1.0, 0.1)`; to be sent again within 0.2 s, or the car stops.

    The car moves by it only under an operator's permit, and safety binds it. open_bus: opens a session of its own.
    """

    def __init__(
        self, thread: LoopThread, open_bus: Callable[[], Awaitable[Bus]], car: str, name: str, hand: ScriptedHand
    ) -> None:
        self._thread = thread
        self._open_bus = open_bus
        self._key = topics.planner_key(car, name)
        self._beat_key = topics.key(car, topics.BEAT)
        self._name = name
        self._hand = hand
        self._session = secrets.randbits(63) + 1
        self._sequence = 0
        self._beat: Beat | None = None
        self._bus: Bus | None = None
        self._loop: asyncio.Task[None] | None = None
        self._heard = asyncio.Event()

    def __enter__(self) -> Self:
        self._thread.call(self._begin())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._thread.call(self._end(orderly=error is None and not self._hand.trouble))

    def send(self, speed_mps: float, steering_rad: float) -> None:
        """Ask for this drive for 0.2 s; PlanRefusedError once this script stalled: the car has lost it."""
        if self._bus is None:
            raise PlanRefusedError(f'use it in a with block: with car.plan("{self._name}") as plan:')
        if self._hand.trouble:
            raise PlanRefusedError(f"{self._hand.trouble}; begin anew with car.plan()")
        self._hand.send(speed_mps, steering_rad, time.monotonic())

    def release(self) -> None:
        """Ask for nothing: the car stops, and this planner keeps it."""
        self._hand.release()

    async def _begin(self) -> None:
        self._bus = bus = await self._open_bus()
        bus.subscribe(self._beat_key, self._on_beat)
        try:
            await asyncio.wait_for(self._heard.wait(), READY_WITHIN_S)
        except TimeoutError:
            await self._end(orderly=False)
            raise PlanRefusedError("no heartbeat from the car") from None
        self._loop = asyncio.create_task(self._run(bus), name="plan")

    async def _run(self, bus: Bus) -> None:
        next_s = time.monotonic()
        while True:
            now_s = time.monotonic()
            inputs = self._hand.inputs(now_s)
            if inputs.live:
                self._send(bus, Press.MANUAL if inputs.manual else Press(0), inputs)
            next_s = max(next_s + PERIOD_S, now_s)
            await asyncio.sleep(max(0.0, next_s - time.monotonic()))

    async def _end(self, *, orderly: bool) -> None:
        """Say goodbye, or after an error fall silent, for which the car stops."""
        loop, self._loop = self._loop, None
        bus, self._bus = self._bus, None
        if loop is not None:
            loop.cancel()
            with suppress(asyncio.CancelledError):
                await loop
        if bus is None:
            return
        try:
            for _ in range(GOODBYES if orderly else 0):
                self._send(bus, Press.GOODBYE, None)
                await asyncio.sleep(PERIOD_S)
        finally:
            await bus.close()

    def _send(self, bus: Bus, flags: Press, inputs: Inputs | None) -> None:
        beat = self._beat
        if beat is None:
            return
        self._sequence += 1
        shape = self._hand.shape
        speed_mps, steering_rad = (
            (inputs.speed * shape.max_speed_mps, inputs.steering * shape.max_steering_rad) if inputs else (0.0, 0.0)
        )
        command = Command(
            self._session, self._sequence, beat.car_session, beat.beat, flags, Input.SCRIPT,
            speed_mps=speed_mps, steering_rad=steering_rad, name=self._name,
        )  # fmt: skip
        bus.put(self._key, command.pack(), encoding=BYTES, urgent=True)

    def _on_beat(self, _key: str, payload: bytes, _arrival_s: float) -> None:
        with suppress(Malformed):
            self._beat = read_beat(payload)
            self._heard.set()
