"""The car's control code on a clock that the caller turns: the live stack and the mux, and nothing around them.

These are the objects that drive the car, not copies.
"""

from typing import Never

from drivers.api import Clock, Drive, Health, LinkState, MotorState
from runtime.arbitration.command import Output
from runtime.live_stack import REQUIRED, LiveStack
from runtime.realtime.stage_timing import StageTimer
from runtime.recording.decision_log import DecisionLog
from runtime.settings.tree import Settings
from runtime.tasks.mux import Mux

AT_ONCE_S = 1e9
"""So long after the last drive every other one may be sent."""


class MotorWire:
    """A motor without wheels: takes a command or does not, as it is told, and reports what it is told.

    takes: whether a controller is there. state: its newest report.
    """

    def __init__(self) -> None:
        self.takes = True
        self.state: MotorState | None = None

    @property
    def health(self) -> Health:
        """Its condition."""
        return Health(LinkState.READY if self.takes else LinkState.ABSENT, "as recorded", "recording")

    async def run(self) -> Never:
        """Refuse: a recording keeps no connection."""
        raise NotImplementedError("as recorded")

    def send(self, drive: Drive) -> bool:  # noqa: ARG002 - it goes nowhere
        """Tell whether it was taken."""
        return self.takes

    def latch_fault(self, words: str) -> None:
        """Have no fault."""

    def clear_fault(self) -> None:
        """Have no fault."""


class ReplayStack:
    """One car's control code, with fresh memories.

    settings: those in force. clock: None for one that stands at `now_s` until it is set.
    """

    def __init__(self, settings: Settings, now_s: float, clock: Clock | None = None) -> None:
        self.now_s = now_s
        self.wire = MotorWire()
        self.stack = LiveStack(settings, DecisionLog(clock or (lambda: self.now_s), most=0))
        self.clock, self.limiter = self.stack.clock, self.stack.limiter
        self.voices, self.laws = self.stack.voices, self.stack.laws
        self.look, self.follow, self.apply = self.stack.look, self.stack.follow, self.stack.apply
        untimed = StageTimer(lambda: 0.0)  # a replay's times mean nothing
        self.mux = Mux(self.voices, self.wire, self.limiter, REQUIRED, self.clock, untimed)

    @property
    def settings(self) -> Settings:
        """The settings in force."""
        return self.stack.settings

    def step(self, *, delivered: bool = True) -> Output:
        """Decide now. delivered: whether the motor takes it."""
        self.wire.takes = delivered
        return self.mux.step()

    def adopt(self, drive: Drive) -> None:
        """Go on from a drive that another source sent: what may follow depends on it."""
        self.limiter.limit(drive.speed_mps, drive.steering_rad, AT_ONCE_S)
