"""The command mux: decides whose word goes to the motor, on every word and on every tick."""

import logging
import math
from collections.abc import Callable
from typing import Never

from drivers.api import Clock, Motor
from runtime.command import Decision, Output, Source, arbitrate
from runtime.control.limiter import Limiter
from runtime.ticker import ticks
from runtime.voices import Voices

log = logging.getLogger("wallride.mux")


class Mux:
    """Looks at the words in force, lets `arbitrate` decide, limits the result and writes it to the motor.

    seconds_by_winner: how long each voice decided, by name; "nobody" for stops by default.
    output: the last decision; the watchdog is petted on the evidence of its age.
    """

    def __init__(
        self, voices: Voices, motor: Motor, limiter: Limiter, required: frozenset[Source], clock: Clock
    ) -> None:
        self._voices = voices
        self._motor = motor
        self._limiter = limiter
        self._required = required
        self._clock = clock
        self._last_s = clock()
        self.output: Output | None = None
        self.seconds_by_winner: dict[str, float] = {}

    async def run(self, publish: Callable[[Output], None]) -> Never:
        """Decide for ever."""
        while True:
            await self._voices.changed()
            publish(self.step())

    def step(self) -> Output:
        """Decide once, now."""
        now_s = self._clock()
        elapsed_s = now_s - self._last_s
        decision = arbitrate(self._voices.live(), self._required, self._voices.order)
        drive = self._limiter.limit(decision.speed_mps, decision.steering_rad, elapsed_s, decision.brake_mps2)
        delivered = self._motor.send(drive)
        if not delivered:
            self._limiter.standstill()
        self._account(decision, elapsed_s)
        self._last_s = now_s
        self.output = Output(now_s, drive, decision, delivered)
        return self.output

    def _account(self, decision: Decision, elapsed_s: float) -> None:
        last = self.output.decision if self.output is not None else None
        if last is not None:
            winner = str(last.winner or "nobody")
            self.seconds_by_winner[winner] = self.seconds_by_winner.get(winner, 0.0) + elapsed_s
        if last is None or (last.reason, last.winner) != (decision.reason, decision.winner):
            measure = "" if math.isnan(decision.measure) else f" ({decision.measure:.2f})"
            log.info("%s: %s%s", decision.winner or "nobody", decision.reason, measure)


async def tick(voices: Voices, rate_hz: float, clock: Clock) -> Never:
    """Wake the mux at a steady rate, so that it also decides in silence."""
    async for _ in ticks(1 / rate_hz, clock):
        voices.tick()
    raise AssertionError("ticks never end")
