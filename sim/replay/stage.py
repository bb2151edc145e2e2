"""The car's control code on a clock that the caller turns: laws, voices, mux and limiter, and nothing around them.

These are the classes that drive the car, not copies. What the tasks of the runtime add to them, two words and their
expiries, stands in `look` and `follow`.
"""

from typing import Never

from drivers.api import Clock, Drive, Health, LinkState, MotorState, Scan
from runtime.app import REQUIRED
from runtime.arbitration.command import CapWord, DriveWord, Outlook, Output, Source
from runtime.arbitration.command_queue import Voices
from runtime.control.guidance import Guidance
from runtime.control.limiter import Limiter, Limits
from runtime.control.live_laws import LiveLaws
from runtime.control.vehicle import CarSettings
from runtime.realtime.stage_timing import StageClock
from runtime.settings.tree import Settings
from runtime.tasks.mux import Mux

AT_ONCE_S = 1e9
"""So long after the last drive every other one may be sent."""


class Wire:
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


class Stage:
    """One car's control code, with fresh memories.

    settings: those in force. clock: None for one that stands at `now_s` until it is set.
    """

    def __init__(self, settings: Settings, now_s: float, clock: Clock | None = None) -> None:
        self.settings = settings
        self.now_s = now_s
        self.clock: Clock = clock or (lambda: self.now_s)
        self.wire = Wire()
        self.voices = Voices(settings.effective_order(), self.clock)
        self.laws = LiveLaws(settings.wall_follow, settings.safety, settings.car, self.clock)
        self.limiter = Limiter(limits(settings.car))
        untimed = StageClock(lambda: 0.0)  # a replay's times mean nothing
        self.mux = Mux(self.voices, self.wire, self.limiter, REQUIRED, self.clock, untimed)

    def look(self, scan: Scan, motor: MotorState | None) -> Outlook:
        """Let safety see a scan and speak, as runtime.tasks.safety does."""
        outlook = self.laws.look(scan, motor)
        word = CapWord(Source.SAFETY, outlook, scan.stamp_s)
        self.voices.say(word, expires_at_s=scan.stamp_s + self.settings.safety.expires_after_s)
        return outlook

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Let the follower see a scan and speak, as runtime.tasks.wall_follow does."""
        guidance = self.laws.follow(scan, motor)
        drive = guidance.drive if guidance.drive is not None else Drive(0.0, 0.0)
        word = DriveWord(Source.NAVIGATION, drive, scan.stamp_s, guidance.reason)
        self.voices.say(word, expires_at_s=scan.stamp_s + self.settings.wall_follow.expires_after_s)
        return guidance

    def step(self, *, delivered: bool = True) -> Output:
        """Decide now. delivered: whether the motor takes it."""
        self.wire.takes = delivered
        return self.mux.step()

    def adopt(self, drive: Drive) -> None:
        """Go on from a drive that another source sent: what may follow depends on it."""
        self.limiter.limit(drive.speed_mps, drive.steering_rad, AT_ONCE_S)

    def apply(self, settings: Settings) -> None:
        """Go on with other settings, as runtime.app does."""
        self.settings = settings
        self.laws.tune(settings.wall_follow, settings.safety)
        self.limiter.tune(limits(settings.car))
        self.voices.reorder(settings.effective_order())


def limits(car: CarSettings) -> Limits:
    """Return what the mechanics allow."""
    return Limits(
        max_speed_mps=car.max_speed_mps,
        max_reverse_mps=car.max_reverse_mps,
        max_steering_rad=car.max_steering_rad,
        steering_rate_radps=car.steering_rate_radps,
        max_acceleration_mps2=car.max_acceleration_mps2,
    )
