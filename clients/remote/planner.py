"""Planning from a script: a navigation source of its own on the car, under safety and permit."""

import asyncio
import secrets
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Final

from wallride.clients.played import why_silent
from wallride.clients.remote.acceptance import Acceptance
from wallride.clients.remote.hand import ScriptedHand
from wallride.clients.remote.loop_thread import LoopThread
from wallride.clients.remote.source_block import READY_WITHIN_S, SourceBlock, SourceRefusedError
from wallride.clients.teleop.inputs import Inputs
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import BYTES
from wallride.runtime.wire.teleop import Beat, Command, Input, Malformed, Press, read_beat

NO_STATUS: Final = "its status, which lists its planners, does not come: is telemetry.rates_hz.status 0?"


class PlanRefusedError(SourceRefusedError):
    """The car does not, or no longer, hear this planner; the text is the reason."""


class RemotePlanner(SourceBlock):
    """`with car.plan("slam") as plan: plan.send(1.0, 0.1)`; to be sent again within 0.2 s, or the car stops.

    The car moves by it only under an operator's permit, and safety binds it. After `release` the car stops, and this
    planner keeps it. open_bus: opens a session of its own.
    """

    def __init__(
        self, thread: LoopThread, open_bus: Callable[[], Awaitable[Bus]], car: str, name: str, hand: ScriptedHand
    ) -> None:
        super().__init__(thread, open_bus, hand, f'car.plan("{name}")', PlanRefusedError)
        self._car = car
        self._key = topics.planner_key(car, name)
        self._name = name
        self._acceptance = Acceptance(car, name)
        self._session = secrets.randbits(63) + 1
        self._sequence = 0
        self._beat: Beat | None = None
        self._news = asyncio.Event()

    async def _begin(self) -> None:
        self._bus = bus = await self._open_bus()
        bus.subscribe(topics.key(self._car, topics.BEAT), self._on_beat)
        bus.subscribe(topics.key(self._car, topics.STATUS), self._on_status)
        acceptance = self._acceptance
        try:
            await self._until(lambda: self._beat is not None, bus, "no heartbeat from the car")
            await self._until(lambda: acceptance.is_listed, bus, NO_STATUS)
            acceptance.begin(time.monotonic())
            self._loop = asyncio.create_task(self._run(bus), name="plan")
            await self._until(lambda: acceptance.accepted, bus, NO_STATUS)
        except BaseException:
            await self._end(orderly=True)
            raise

    async def _until(self, reached: Callable[[], bool], bus: Bus, silent: str) -> None:
        """Wait for it; PlanRefusedError with the status's reason against it, or `silent` without one in time."""
        try:
            async with asyncio.timeout(READY_WITHIN_S):
                while not reached():
                    if self._acceptance.refused and self._beat is not None:  # without a beat it may be no car
                        raise PlanRefusedError(self._acceptance.refused)
                    await self._news.wait()
                    self._news.clear()
        except TimeoutError:
            why = await why_silent(bus, self._car, silent)
            raise PlanRefusedError(f"{self._car} cannot be planned for now: {why}") from None

    def _step(self, bus: Bus, now_s: float) -> None:
        inputs = self._hand.inputs(now_s)
        if inputs.live:
            self._send(bus, Press.MANUAL if inputs.manual else Press(0), inputs)

    def _say_goodbye(self, bus: Bus, *, orderly: bool) -> None:
        self._send(bus, Press.GOODBYE if orderly else Press.GOODBYE | Press.UNSURE, None)

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
            self._news.set()

    def _on_status(self, _key: str, payload: bytes, arrival_s: float) -> None:
        with suppress(AttributeError, LookupError, TypeError, ValueError):  # the next one comes in a tenth of a second
            self._acceptance.hear(topics.decode(payload), arrival_s)
            self._news.set()
