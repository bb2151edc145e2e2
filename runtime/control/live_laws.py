"""Follower and safety law of a car, with settings that may change while it drives.

The state of the laws (the steering's offset, the dirt on the window, an active hard stop, the moving obstacles) is
kept; only another method begins anew. Each law computes a scan wholly with the old or wholly with the new values.
"""

from wallride.drivers.api import Clock, MotorState, Scan
from wallride.runtime.arbitration.command import SafetyAssessment, Verdict
from wallride.runtime.control import methods
from wallride.runtime.control.guidance import Follower, Guidance
from wallride.runtime.control.method_settings import (
    BallFollowSettings,
    OwnSafetySettings,
    SafetySettings,
    SweptSafetySettings,
    WallFollowSettings,
)
from wallride.runtime.control.own_laws.follower import OwnFollower
from wallride.runtime.control.own_laws.guard import CappedGuard, GuardedReport
from wallride.runtime.control.own_laws.runner import LawRunner
from wallride.runtime.control.own_laws.settings import OwnFollowSettings
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.own_parts import KnownParts
from wallride.runtime.control.perception.plausibility import Plausibility
from wallride.runtime.control.perception.view import PerceptionCache
from wallride.runtime.control.report.laws import ReportFollower
from wallride.runtime.control.report.settings import ReportFollowSettings, ReportSafetySettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.ball import BallFollower


class LiveLaws:
    """Implements Follower and Guard by delegation to the laws that the settings name.

    wall_follow, safety: the settings in force. guard: the car's own, which every safety law stands
    under. plausibility: whether what the laws are given makes sense; where it does not, the answer is a stop with that
    reason.
    """

    def __init__(
        self, wall_follow: WallFollowSettings, safety: SafetySettings, car: CarSettings, clock: Clock | None = None
    ) -> None:
        self.wall_follow = wall_follow
        self.safety = safety
        self._car = car
        self._clock = clock
        self._eyes = PerceptionCache(car)
        self.plausibility = Plausibility(car)
        self._driver = methods.driver_for(wall_follow, car, self._eyes, clock)
        self._recovery = methods.recovery_for(safety)
        self.guard = methods.guard_for(safety, car, self._eyes, clock)
        self._judge = methods.judge_for(self.guard, safety, wall_follow, clock)
        self.follower: Follower = self._wrapped(wall_follow)

    @property
    def words(self) -> tuple[str, ...]:
        """Faults of the lidar's window, implausible sensor data, faults of own laws, in sentences for the user."""
        return (*self.guard.words, *self.plausibility.words, *filter(None, [self.own_law_fault]))

    @property
    def own_law_fault(self) -> str:
        """Fault of an own law, which stops the car until the law is tried again; "" without one."""
        return "; ".join(runner.fault for runner in self.runners if runner.fault)

    @property
    def own_parts(self) -> KnownParts | None:
        """The car's known own parts, None before the first scan."""
        return self.guard.own_parts.known

    @property
    def own_parts_changes(self) -> int:
        """Number of changes of the set of own parts by observation."""
        return self.guard.own_parts.changes

    def remember_own_parts(self, known: KnownParts | None) -> None:
        """Restore these own parts, known from before, and reset the state of the window."""
        self.guard.remember(known)

    @property
    def path_m(self) -> Floats | None:
        """Path of the follower's ball, (2, k) in base_link; None where there is none."""
        return self._driver.path_m

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan."""
        return self.follower.follow(scan, motor)

    def look(self, scan: Scan, motor: MotorState | None) -> SafetyAssessment:
        """Process one scan."""
        self.plausibility.look(scan, motor, odometry_check=self.safety.odometry_check)
        assessment = self._judge.look(scan, motor)
        doubt = self.plausibility.lidar_doubt or self.plausibility.motor_doubt
        return Verdict(0.0, 0.0, doubt) if doubt else assessment

    def learn(self) -> None:
        """Run the deferrable work after the answer is sent."""
        self.guard.learn()
        if self._recovery is not None:
            self._recovery.think()
        self.plausibility.learn()

    def tune(self, wall_follow: WallFollowSettings, safety: SafetySettings) -> None:
        """Change the settings, from the next scan on. An own law with a fault is tried again by a change of its own."""
        if wall_follow != self.wall_follow:
            self._tune_driver(wall_follow)
        if safety != self.safety:
            self._tune_guard(safety)
        self._tune_judge(wall_follow, safety)
        self.wall_follow, self.safety = wall_follow, safety
        self.follower = self._wrapped(wall_follow)

    def retry_own_laws(self) -> None:
        """Make own laws with a fault anew."""
        for runner in self.runners:
            runner.retry()

    @property
    def runners(self) -> list[LawRunner]:
        """The own laws in force."""
        return [law.runner for law in (self._driver, self._judge) if isinstance(law, OwnFollower | CappedGuard)]

    def _wrapped(self, wall_follow: WallFollowSettings) -> Follower:
        return methods.wrapped(
            self._driver, self._judge, self._recovery, wall_follow, lambda: self.plausibility.believed
        )

    def _tune_driver(self, settings: WallFollowSettings) -> None:
        match self._driver, settings:
            case BallFollower() as driver, BallFollowSettings():
                driver.tune(settings)
            case ReportFollower() as driver, ReportFollowSettings():
                driver.tune(settings)
            case OwnFollower() as driver, OwnFollowSettings() if settings.method == driver.runner.law.name:
                driver.tune(settings)
            case _:
                self._driver = methods.driver_for(settings, self._car, self._eyes, self._clock)

    def _tune_judge(self, wall_follow: WallFollowSettings, safety: SafetySettings) -> None:
        """Tune the law that stands under the guard, or put another one, or none, under it."""
        match self._judge, safety:
            case CappedGuard() as judge, OwnSafetySettings() if judge.runner.law.name == safety.method:
                judge.tune(safety, wall_follow)
            case GuardedReport() as judge, ReportSafetySettings():
                judge.law.tune(safety)
            case _:
                self._judge = methods.judge_for(self.guard, safety, wall_follow, self._clock)

    def _tune_guard(self, settings: SafetySettings) -> None:
        swept = methods.swept_settings(settings)
        self.guard.tune(swept, swept.window)
        if self._recovery is None or not isinstance(settings, SweptSafetySettings) or not settings.backs_out:
            self._recovery = methods.recovery_for(settings)
        else:
            self._recovery.tune(settings.recovery)
