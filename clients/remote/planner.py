"""Planning from a script: a navigation source of its own on the car, under safety and permit."""

import asyncio
import secrets
from collections.abc import Awaitable, Callable
from contextlib import suppress

from clients.remote.hand import ScriptedHand
from clients.remote.loop_thread import LoopThread
from clients.remote.source_block import READY_WITHIN_S, SourceBlock
from clients.teleop.inputs import Inputs
from runtime.wire import topics
from runtime.wire.bus import Bus
from runtime.wire.network import BYTES
from runtime.wire.teleop import Beat, Command, Input, Malformed, Press, read_beat


class PlanRefusedError(Exception):
    """The car does not, or no longer, hear this planner; the text is the reason."""


class RemotePlanner(SourceBlock):
    """`with car.plan("slam") as plan: plan.send(1.0, 0.1)`; to be sent again within 0.2 s, or the car stops.

    The car moves by it only under an operator's permit, and safety binds it. open_bus: opens a session of its own.
    """

    def __init__(
        self, thread: LoopThread, open_bus: Callable[[], Awaitable[Bus]], car: str, name: str, hand: ScriptedHand
    ) -> None:
        super().__init__(thread, open_bus, hand, f'car.plan("{name}")', PlanRefusedError)
        self._key = topics.planner_key(car, name)
        self._beat_key = topics.key(car, topics.BEAT)
        self._name = name
        self._session = secrets.randbits(63) + 1
        self._sequence = 0
        self._beat: Beat | None = None
        self._heard = asyncio.Event()

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

    def _step(self, bus: Bus, now_s: float) -> None:
        inputs = self._hand.inputs(now_s)
        if inputs.live:
            self._send(bus, Press.MANUAL if inputs.manual else Press(0), inputs)

    def _say_goodbye(self, bus: Bus) -> None:
        self._send(bus, Press.GOODBYE, None)

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
