"""Driving from a script: an operator's session of its own, with token, heartbeat's echo, deadman and goodbye."""

import asyncio
import math
import secrets
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from typing import Final

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.played import why_silent
from wallride.clients.remote.hand import UNHEEDED, ScriptedHand
from wallride.clients.remote.loop_thread import LoopThread
from wallride.clients.remote.source_block import PERIOD_S, READY_WITHIN_S, SourceBlock, SourceRefusedError
from wallride.clients.teleop.pilot import MINDED_S, Pilot, PilotState
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import BYTES
from wallride.runtime.wire.teleop import CarCondition, Command, Input, Malformed, Press, read_beat

LATCHED_WITHIN_S: Final = 1.0
"""Time for which a block that pressed the e-stop insists on it at its end."""
UNCONFIRMED: Final = (
    f"the car did not confirm the e-stop within {LATCHED_WITHIN_S} s: stop it by hand; is the link fast enough,"
    " and over tls your certificate's role operator or admin?"
)


class DriveRefusedError(SourceRefusedError):
    """The car does not, or no longer, obey this script; the text is the reason."""


class RemoteDriver(SourceBlock):
    """`with car.drive() as hand: hand.send(1.0, 0.1)`; to be sent again within 0.2 s, or the car stops.

    After `release` the car stops, unless it may drive by itself. open_bus: opens a session of its own, which ends with
    the block. name: shown by the car.
    """

    def __init__(
        self, thread: LoopThread, open_bus: Callable[[], Awaitable[Bus]], car: str, name: str, hand: ScriptedHand
    ) -> None:
        super().__init__(thread, open_bus, hand, "car.drive()", DriveRefusedError)
        self._car = car
        self._pilot = Pilot(secrets.randbits(63) + 1, name, hand.shape)
        self._ready = asyncio.Event()
        self._obeyed = asyncio.Event()
        self._latched = asyncio.Event()
        self._stop_s = math.inf

    def e_stop(self) -> None:
        """Press the e-stop; it stays latched until an operator resets it.

        On return it was sent; it is repeated until the block ends, which waits for the car to confirm it.
        """
        self._check_begun()
        self._thread.call(self._press_e_stop())

    async def _press_e_stop(self) -> None:
        self._hand.press_e_stop()
        self._stop_s = min(self._stop_s, time.monotonic())
        await asyncio.sleep(2 * PERIOD_S)  # sent twice: the script may close the connection at once

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
            why = await why_silent(bus, self._car, str(block or "no answer"))
            await self._end(orderly=True)
            raise DriveRefusedError(f"{self._car} cannot be driven now: {why}") from None

    def _step(self, bus: Bus, now_s: float) -> None:
        self._send(bus, self._pilot.step(self._hand.inputs(now_s), now_s))
        if (state := self._pilot.situation) is not None:
            if state.mine:
                self._obeyed.set()
            self._hand.note(state)
            if state.armed:
                self._ready.set()
            if self._has_latched(state, now_s):
                self._latched.set()

    def _has_latched(self, state: PilotState, now_s: float) -> bool:
        """Tell whether a heartbeat from after the press says that the e-stop is latched."""
        beat = state.beat
        return beat is not None and CarCondition.ESTOP_LATCHED in beat.flags and now_s - state.beat_age_s > self._stop_s

    async def _end(self, *, orderly: bool) -> None:
        if self._bus is not None and self._hand.stopping:  # also after an error: the e-stop was pressed for it
            with suppress(TimeoutError):
                async with asyncio.timeout(LATCHED_WITHIN_S):
                    await self._latched.wait()
        elif orderly and self._bus is not None and self._hand.asked and not self._obeyed.is_set():
            await self._wait_for_the_answer()
        await super()._end(orderly=orderly)

    async def _wait_for_the_answer(self) -> None:
        """Hold the deadman with centred sticks until the car answers, at most MINDED_S, and release it.

        A block may be shorter than the way to the car and back, and the car's rate limit drops a press that comes
        within 2 ms after the release before it.
        """
        until_s = time.monotonic() + MINDED_S
        while not self._obeyed.is_set() and not self._hand.trouble and (now_s := time.monotonic()) < until_s:
            self._hand.send(0.0, 0.0, now_s)
            await asyncio.sleep(PERIOD_S)
        self._hand.release()

    def _unobeyed(self) -> str:
        if self._hand.stopping:
            return "" if self._latched.is_set() else UNCONFIRMED
        return self._hand.trouble or (UNHEEDED if self._hand.asked and not self._obeyed.is_set() else "")

    def _say_goodbye(self, bus: Bus, *, orderly: bool) -> None:
        command = self._pilot.goodbye(Input.SCRIPT)
        self._send(bus, command if orderly else replace(command, flags=command.flags | Press.UNSURE))

    def _send(self, bus: Bus, command: Command) -> None:
        if self._pilot.is_addressed(command):
            bus.put(topics.key(self._car, topics.COMMAND), command.pack(), encoding=BYTES, urgent=True)

    def _on_beat(self, _key: str, payload: bytes, arrival_s: float) -> None:
        with suppress(Malformed):
            self._pilot.hear(read_beat(payload), arrival_s)


def checked_hand(max_speed_mps: float, max_steering_rad: float) -> ScriptedHand:
    """Return a hand; ConnectionProblemError for limits that are none."""
    try:
        return ScriptedHand(max_speed_mps, max_steering_rad)
    except ValueError as error:
        raise ConnectionProblemError(str(error)) from None
