"""The command mux: decides which source's command goes to the motor, on every new command and on every tick."""

import logging
from collections.abc import Callable
from typing import Never

from wallride.drivers.api import Clock, Motor
from wallride.runtime.arbitration.command import NO_WINNER, Decision, Output, Source, arbitrate
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.control.limiter import Limiter
from wallride.runtime.realtime.periodic import Tick
from wallride.runtime.realtime.stage_timing import StageTimer
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.telemetry.screen_words import because

log = logging.getLogger("wallride.mux")

SILENT_AFTER_PERIODS = 1.5
"""Silence after which the mux ticks, in periods of its rate. At 50 Hz that is 30 ms: scans at 40 Hz leave no
silence."""


class Mux:
    """Reads the commands and limits in force, calls `arbitrate`, limits the result and writes it to the motor.

    seconds_by_winner: total time that each source decided, by name; NO_WINNER for stops by default.
    output: the last decision; its age is the evidence on which the watchdog is notified. heed: told each decision.
    """

    def __init__(
        self,
        queue: CommandQueue,
        motor: Motor,
        limiter: Limiter,
        required: frozenset[Source],
        clock: Clock,
        stages: StageTimer | None = None,
        decision_log: DecisionLog | None = None,
        heed: Callable[[Decision], None] = lambda _: None,
    ) -> None:
        self._queue = queue
        self._motor = motor
        self._limiter = limiter
        self._required = required
        self._clock = clock
        self._stages = stages or StageTimer(clock)
        self._decision_log = decision_log or DecisionLog(clock, 0)
        self._heed = heed
        self._last_s = clock()
        self._publish: Callable[[Output], None] = lambda _: None
        self.output: Output | None = None
        self.seconds_by_winner: dict[str, float] = {}

    async def run(self, publish: Callable[[Output], None]) -> Never:
        """Run the decision loop."""
        self._publish = publish
        while True:
            await self._queue.changed()
            self._decide()

    def decide_now(self) -> None:
        """Decide at once instead of at the loop's next turn, if there is a change: for the last command on a scan."""
        if self._queue.take_change():
            self._decide()

    def _decide(self) -> None:
        self._publish(self.step())

    def step(self) -> Output:
        """Decide once, now."""
        stages = self._stages
        stages.mux.begin()
        self._decision_log.begin()
        now_s = self._clock()
        elapsed_s = now_s - self._last_s
        live = self._queue.sweep()
        decision, memories = arbitrate(live, self._required, self._queue.order)
        drive = self._limiter.limit(decision.speed_mps, decision.steering_rad, elapsed_s, decision.brake_mps2)
        stages.mux.end()
        stages.write.begin()
        delivered = self._motor.send(drive)
        stages.write.end()
        for assessment, memory in memories:
            assessment.commit(memory)
        braked = delivered and self._motor.braked_instead
        if not delivered:
            self._limiter.standstill()
        elif braked:
            self._limiter.braked()
        self._heed(decision)
        self._account(decision, elapsed_s)
        self._last_s = now_s
        self.output = Output(now_s, drive, decision, delivered, braked)
        self._decision_log.add_decision(elapsed_s, live, self.output)
        return self.output

    def _account(self, decision: Decision, elapsed_s: float) -> None:
        last = self.output.decision if self.output is not None else None
        if last is not None:
            winner = str(last.winner or NO_WINNER)
            self.seconds_by_winner[winner] = self.seconds_by_winner.get(winner, 0.0) + elapsed_s
        if last is None or (last.reason, last.winner) != (decision.reason, decision.winner):
            log.info("%s: %s", decision.winner or NO_WINNER, because(decision.reason, decision.measure))


class SilenceTick:
    """Wakes the mux at a steady rate in silence: one that only forwards would go silent instead of stopping.

    While commands arrive often enough, and none has expired, a tick would only repeat them. noted: called with the
    lateness of each tick, and the number of missed ticks.
    """

    def __init__(
        self, queue: CommandQueue, rate_hz: float, clock: Clock, noted: Tick = lambda _late_s, _missed: None
    ) -> None:
        self._queue = queue
        self._silent_after_s = SILENT_AFTER_PERIODS / rate_hz
        self._clock = clock
        self._noted = noted

    def tick(self, late_s: float, missed: int) -> None:
        """Check once; a `periodic.Tick`."""
        self._noted(late_s, missed)
        queue = self._queue
        if queue.has_expired() or self._clock() - queue.last_put_s >= self._silent_after_s:
            queue.tick()
