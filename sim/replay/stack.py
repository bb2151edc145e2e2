"""Control code of the car on a clock set by the caller: the live stack and the mux, without their surroundings.

These are the objects that drive the car, not copies.
"""

from typing import Never

from wallride.drivers.api import Clock, Drive, Health, LinkState, MotorState, Scan
from wallride.runtime.arbitration.command import Output
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.live_stack import REQUIRED, LiveStack
from wallride.runtime.realtime.stage_timing import StageTimer
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.settings.tree import Settings
from wallride.runtime.tasks.mux import Mux

AT_ONCE_S = 1e9
"""Time since the last drive after which the limiter allows every other one."""


class MotorWire:
    """Motor without wheels: accepts or rejects commands, and reports states, as set by the caller.

    takes: whether a controller is there. braked_instead: whether it brakes by itself. state: its newest report.
    """

    def __init__(self) -> None:
        self.takes = True
        self.braked_instead = False
        self.state: MotorState | None = None

    @property
    def health(self) -> Health:
        """Return the condition."""
        return Health(LinkState.READY if self.takes else LinkState.ABSENT, "as recorded", "recording")

    async def run(self) -> Never:
        """Refuse: a recording keeps no connection."""
        raise NotImplementedError("as recorded")

    def send(self, drive: Drive) -> bool:  # noqa: ARG002 - it goes nowhere
        """Return whether the command was accepted."""
        return self.takes

    def latch_fault(self, words: str) -> None:
        """Do nothing."""

    def retry_fault(self) -> None:
        """Do nothing."""

    def clear_fault(self) -> None:
        """Do nothing."""


class ReplayStack:
    """Control code of one car, with fresh memories.

    settings: those in force. clock: None for one that stands at `now_s` until it is set. course: that of the car.
    """

    def __init__(
        self, settings: Settings, now_s: float, clock: Clock | None = None, course: RaceCourse | None = None
    ) -> None:
        self.now_s = now_s
        self.wire = MotorWire()
        self.stack = LiveStack(settings, DecisionLog(clock or (lambda: self.now_s), most=0), course)
        self.clock, self.limiter = self.stack.clock, self.stack.limiter
        self.queue, self.laws = self.stack.queue, self.stack.laws
        self.look, self.apply = self.stack.look, self.stack.apply
        untimed = StageTimer(lambda: 0.0)  # a replay's durations have no meaning
        heed = self.stack.heed
        self.mux = Mux(self.queue, self.wire, self.limiter, REQUIRED, self.clock, untimed, heed=heed)

    @property
    def settings(self) -> Settings:
        """Return the settings in force."""
        return self.stack.settings

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer a scan, and find the pose at it as the car does, whatever drives."""
        guidance = self.stack.follow(scan, motor)
        self.stack.locate(scan)
        return guidance

    def step(self, *, delivered: bool = True, braked: bool = False) -> Output:
        """Decide now. delivered: whether the motor accepts the command. braked: whether it brakes instead."""
        self.wire.takes, self.wire.braked_instead = delivered, braked
        return self.mux.step()

    def adopt(self, drive: Drive) -> None:
        """Continue from a drive that another source sent: the limits of the next one depend on it."""
        self.limiter.limit(drive.speed_mps, drive.steering_rad, AT_ONCE_S)
