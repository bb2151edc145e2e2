"""Rehearsal of the way from a scan to the motor, shortly before the next scan is due.

Between two scans the process sleeps for 20 ms, and other work evicts its code and data from the processor's caches: the
same answer takes three to four times as long as in a loop. So the newest scan goes the way once more, through laws of
its own and to no wire, and the next scan finds code and tables warm. A rehearsal decides nothing and learns nothing. It
runs only while the car drives freely, and not on a computer that is too slow for it (decision 13).
"""

import asyncio
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from wallride.drivers.api import Clock, MotorState, Scan
from wallride.runtime.arbitration.command import Output, Source, arbitrate, consent
from wallride.runtime.control.method_settings import BallFollowSettings, SweptSafetySettings
from wallride.runtime.control.own_laws.law_class import is_own
from wallride.runtime.live_stack import REQUIRED, LiveStack
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.settings.tree import Settings

SPARE_S: Final = 0.001
"""Time from the end of a rehearsal to the scan: a scan comes a little early sometimes."""
MAX_TOOK_S: Final = 0.003
"""Duration after which the next rehearsals are left out: a scan that comes early would wait for one."""
_FASTER_GAIN: Final = 0.02
_PERIOD_S: Final = 0.025


class Rehearsal:
    """Laws, queue and limiter beside those of the car. took_s: duration of a rehearsal, slower ones count at once.

    read: reads the newest scan once more, where its driver's way from bytes to a scan is long.
    """

    def __init__(self, settings: Settings, clock: Clock) -> None:
        self._clock = clock
        self._stack = LiveStack(_built_in(settings), DecisionLog(clock, 0))
        self._stack.queue.put(consent(Source.PERMIT, "rehearsal"))
        self.took_s = 0.0
        self.read: Callable[[], None] = lambda: None
        self._planned: asyncio.TimerHandle | None = None

    def apply(self, settings: Settings) -> None:
        """Follow a change of the car's settings."""
        self._stack.apply(_built_in(settings))

    def warm_up(self) -> None:
        """Answer synthetic scans, a drive backwards and an emergency among them: first calls are the slowest."""
        step_rad, beams = math.radians(0.25), 1081
        for sequence, speed_mps in enumerate((1.0, 1.0, 8.0)):
            now_s, ranges_m = self._clock(), np.linspace(1.0, 3.0, beams, dtype=np.float32)
            scan = Scan(now_s, now_s, -step_rad * (beams // 2), step_rad, 0.02, 30.0, ranges_m, sequence)
            motor = MotorState(now_s, speed_mps, 0.0, 0.0, 12.0, 0.0, 0.0, 20.0, "", timed_out=False, killed=False)
            self._answer(scan, motor)
            assessment = self._stack.look(scan, motor)
            for wish_mps in (-0.4, speed_mps):
                assessment.judge(wish_mps, 0.1, assessment.memory)
            self._stack.laws.learn()

    def plan(self, scan: Scan, motor: MotorState | None, output: Output | None, due_s: float) -> None:
        """Rehearse a scan in time for the next, due at that time (NaN: not known), where its answer drove the car."""
        if self._planned is not None:
            self._planned.cancel()  # scans that come in one read are due once
        if output is None or output.decision.speed_mps == 0.0 or output.decision.winner is not output.decision.driver:
            return  # what brakes needs no rehearsal, and one would not be short
        if self.took_s > MAX_TOOK_S:
            self.took_s *= 1.0 - _FASTER_GAIN  # tried again after a busy moment; never after one that failed
            return
        in_s = due_s - SPARE_S - self.took_s - self._clock()
        if in_s > 0.0:
            self._planned = asyncio.get_running_loop().call_later(in_s, self._rehearse, scan, motor)

    def _rehearse(self, scan: Scan, motor: MotorState | None) -> None:
        before_s, self.took_s, began_s = self.took_s, math.inf, self._clock()  # one that fails is the last
        self.read()
        self._answer(replace(scan, stamp_s=began_s, received_s=began_s), motor)
        took_s = self._clock() - began_s
        self.took_s = max(took_s, before_s + _FASTER_GAIN * (took_s - before_s))

    def _answer(self, scan: Scan, motor: MotorState | None) -> None:
        stack = self._stack
        stack.look(scan, motor)
        stack.follow(scan, motor)
        decision, memories = arbitrate(stack.queue.sweep(), REQUIRED, stack.queue.order)
        for assessment, memory in memories:
            assessment.commit(memory)
        stack.limiter.limit(decision.speed_mps, decision.steering_rad, _PERIOD_S, decision.brake_mps2)
        stack.laws.forget_newest()


def _built_in(settings: Settings) -> Settings:
    """Return the settings with built-in laws in place of the user's, which are called for real scans alone.

    The rehearsal has no map: `ball` takes the place of `line`, too.
    """
    changes: dict[str, object] = {}
    if is_own(settings.wall_follow.method) or settings.wall_follow.method == "line":
        changes["wall_follow"] = BallFollowSettings()
    if is_own(settings.safety.method):
        changes["safety"] = SweptSafetySettings()
    return settings.model_copy(update=changes)
