"""The laws by name, as two tables, and the laws of one car, with settings that may change while it drives.

A built-in follower is a `Driver` with its settings in `method_settings` and a row of FOLLOWERS; a safety law has a row
of SAFETY. The state of the laws (the steering's offset, the dirt on the window, an active hard stop, the moving
obstacles) is kept when settings change; only another method begins anew. Each law computes a scan wholly with the old
or wholly with the new values.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from wallride.drivers.api import Clock, MotorState, Scan
from wallride.runtime.arbitration.command import SafetyAssessment, Verdict
from wallride.runtime.control.corridor_following.corridor_follower import CorridorFollower
from wallride.runtime.control.guidance import Driver, Follower, Guard, Guidance
from wallride.runtime.control.line_following.course import RaceCourse
from wallride.runtime.control.line_following.line_follower import LineFollower
from wallride.runtime.control.method_settings import (
    OwnSafetySettings,
    SafetySettings,
    SweptSafetySettings,
    WallFollowSettings,
)
from wallride.runtime.control.own_laws.follower import OwnFollower
from wallride.runtime.control.own_laws.guard import CappedGuard, GuardedReport
from wallride.runtime.control.own_laws.law_class import OWN_TAG, is_own, load_law
from wallride.runtime.control.own_laws.runner import LawRunner
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.own_parts import KnownParts
from wallride.runtime.control.perception.perception import Perception
from wallride.runtime.control.perception.plausibility import Plausibility
from wallride.runtime.control.recovery.recovering_follower import RecoveringFollower
from wallride.runtime.control.recovery.way_out import Recovery
from wallride.runtime.control.report.laws import ReportFollower, ReportTurn
from wallride.runtime.control.safety.swept import SweptGuard, assumed
from wallride.runtime.control.safety.swept_settings import RecoverySettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.ball import BallFollower


@dataclass(frozen=True, slots=True)
class Parts:
    """What laws are made of. clock: measures the answers of own laws, and the age of a scan at every judgement.

    course: map, pose and line, None for a car without a map.
    """

    car: CarSettings
    perception: Perception
    clock: Clock | None = None
    course: RaceCourse | None = None


@dataclass(frozen=True, slots=True)
class SafetyRow:
    """A safety law. Each stands under the car's own guard, and can only lower its limits.

    build: makes it. tune: changes its settings; those of the guard are changed already. around: the follower with what
    the law adds to it. recovers: whether a car that is boxed in backs out, where the settings let it.
    """

    build: Callable[[SweptGuard, Any, WallFollowSettings, Clock | None], Guard]
    tune: Callable[[Any, Any, WallFollowSettings], None]
    around: Callable[["LawStack"], Follower]
    recovers: bool = True


def _recovering(laws: "LawStack") -> Follower:
    if laws.recovery is None:
        driver: Follower = laws.driver
        return driver
    return RecoveringFollower(laws.driver, laws.guard, laws.recovery, laws.believed)


def _turning(laws: "LawStack") -> Follower:
    return ReportTurn(laws.driver, laws.judge.law, laws.wall_follow.side)


def _own(guard: SweptGuard, settings: OwnSafetySettings, wanted: WallFollowSettings, clock: Clock | None) -> Guard:
    return CappedGuard(guard, load_law("safety", settings.method), settings, wanted, clock)


FOLLOWERS: Mapping[str, Callable[[Any, Parts], Driver]] = MappingProxyType(
    {
        "ball": lambda settings, parts: BallFollower(settings, parts.car, parts.perception.views),
        "report": lambda settings, _: ReportFollower(settings),
        "line": lambda settings, parts: LineFollower(settings, parts.car, parts.perception, parts.course),
        "corridor": lambda settings, parts: CorridorFollower(settings, parts.car, parts.perception),
        OWN_TAG: lambda settings, parts: OwnFollower(
            load_law("wall_follow", settings.method), settings, parts.car, parts.perception, parts.clock
        ),
    }
)
SAFETY: Mapping[str, SafetyRow] = MappingProxyType(
    {
        "swept": SafetyRow(lambda guard, *_: guard, lambda *_: None, _recovering),
        "report": SafetyRow(
            lambda guard, settings, *_: GuardedReport(guard, settings),
            lambda judge, settings, _: judge.law.tune(settings),
            _turning,
            recovers=False,
        ),
        OWN_TAG: SafetyRow(_own, lambda judge, settings, wanted: judge.tune(settings, wanted), _recovering),
    }
)


def _key(method: str) -> str:
    return OWN_TAG if is_own(method) else method


def own_law_mistakes(wall_follow: WallFollowSettings, safety: SafetySettings, car: CarSettings) -> list[str]:
    """Return what is wrong with making the own laws that the settings name, one sentence each."""
    named: list[tuple[str, Any]] = [("wall_follow", wall_follow), ("safety", safety)]
    runners = [
        LawRunner(load_law(section, settings.method), settings.own, car, None)
        for section, settings in named
        if is_own(settings.method)
    ]
    return [runner.fault for runner in runners if runner.fault]


class LawStack:
    """The laws that the settings name, one upon the other, sharing one view of each scan.

    perception: what all of them read. follower: what answers a scan: the driver with what its safety law adds to it.
    driver: the follower of the table, or another one given for it. guard: the car's own, which every safety law stands
    under. judge: the safety law.
    """

    def __init__(
        self, wall_follow: WallFollowSettings, safety: SafetySettings, car: CarSettings, clock: Clock | None = None,
        driver: Callable[[Parts], Any] | None = None, course: RaceCourse | None = None,
    ) -> None:  # fmt: skip
        self.wall_follow, self.safety = wall_follow, safety
        swept = _swept(safety)
        self.perception = Perception(car, assumed(swept, swept.window))
        self._parts = parts = Parts(car, self.perception, clock, course)
        self.driver: Any = driver(parts) if driver is not None else _driver(wall_follow, parts)
        self.guard = SweptGuard(swept, car, self.perception, clock=clock)
        self.judge: Any = self._row.build(self.guard, safety, wall_follow, clock)
        self.recovery = self._new_recovery(safety)
        self.follower = self._row.around(self)

    @property
    def runners(self) -> list[LawRunner]:
        """The own laws in force."""
        return [
            law.runner
            for law, settings in ((self.driver, self.wall_follow), (self.judge, self.safety))
            if is_own(settings.method)
        ]

    @property
    def own_law_fault(self) -> str:
        """Fault of an own law, which stops the car until the law is tried again; "" without one."""
        return "; ".join(runner.fault for runner in self.runners if runner.fault)

    def believed(self) -> bool:
        """Tell whether the odometry is good enough to back out by."""
        return True

    def tune(self, wall_follow: WallFollowSettings, safety: SafetySettings) -> None:
        """Change the settings, from the next scan on. An own law with a fault is tried again by a change of its own."""
        if wall_follow.method != self.wall_follow.method:
            self.driver = _driver(wall_follow, self._parts)
        elif wall_follow != self.wall_follow:
            self.driver.tune(wall_follow)
        before, self.wall_follow = self.safety.method, wall_follow
        if safety != self.safety:
            self._tune_guard(safety)
        self.safety = safety
        if safety.method == before:
            self._row.tune(self.judge, safety, wall_follow)
        else:
            self.judge = self._row.build(self.guard, safety, wall_follow, self._parts.clock)
        self.follower = self._row.around(self)

    @property
    def _row(self) -> SafetyRow:
        return SAFETY[_key(self.safety.method)]

    def _tune_guard(self, safety: SafetySettings) -> None:
        swept = _swept(safety)
        self.perception.tune(assumed(swept, swept.window))
        self.guard.tune(swept)
        if self.recovery is None or not SAFETY[_key(safety.method)].recovers or not swept.backs_out:
            self.recovery = self._new_recovery(safety)
        else:
            self.recovery.tune(swept.recovery)

    @staticmethod
    def _new_recovery(safety: SafetySettings) -> Recovery | None:
        """Return a recovery, which only asks for help where the settings forbid a way out."""
        return Recovery(recovery_settings(_swept(safety))) if SAFETY[_key(safety.method)].recovers else None


class LiveLaws(LawStack):
    """The laws of a car that drives: with a check whether what they are given makes sense.

    plausibility: where it does not, the answer is a stop with that reason.
    """

    def __init__(
        self, wall_follow: WallFollowSettings, safety: SafetySettings, car: CarSettings, clock: Clock | None = None,
        course: RaceCourse | None = None,
    ) -> None:  # fmt: skip
        self.plausibility = Plausibility(car)
        super().__init__(wall_follow, safety, car, clock, course=course)

    @property
    def words(self) -> tuple[str, ...]:
        """Faults of the lidar's window, implausible sensor data, faults of own laws, in sentences for the user."""
        return (*self.guard.words, *self.plausibility.words, *filter(None, [self.own_law_fault]))

    @property
    def own_parts(self) -> KnownParts | None:
        """The car's known own parts, None before the first scan."""
        return self.perception.own_parts.known

    @property
    def own_parts_changes(self) -> int:
        """Number of changes of the set of own parts by observation."""
        return self.perception.own_parts.changes

    @property
    def path_m(self) -> Floats | None:
        """Path that the follower plans, (2, k) in base_link; None where it plans none."""
        path_m: Floats | None = self.driver.path_m
        return path_m

    @property
    def race(self) -> Mapping[str, Any]:
        """Return laps and errors along the line; nothing where no line is driven."""
        figures: Mapping[str, Any] = self.driver.figures
        return figures

    def remember_own_parts(self, known: KnownParts | None) -> None:
        """Restore these own parts, known from before, and reset the state of the window."""
        self.perception.remember(known)

    def believed(self) -> bool:
        """Tell whether the odometry is good enough to back out by."""
        return self.plausibility.believed

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan."""
        return self.follower.follow(scan, motor)

    def look(self, scan: Scan, motor: MotorState | None) -> SafetyAssessment:
        """Process one scan."""
        self.plausibility.look(self.perception.look(scan, motor), odometry_check=self.safety.odometry_check)
        assessment: SafetyAssessment = self.judge.look(scan, motor)
        doubt = self.plausibility.lidar_doubt or self.plausibility.motor_doubt
        return Verdict(0.0, 0.0, doubt) if doubt else assessment

    def learn(self) -> None:
        """Run the deferrable work after the answer is sent."""
        self.perception.learn()
        if self.recovery is not None:
            self.recovery.think()
        self.plausibility.learn()

    def forget_newest(self) -> None:
        """Learn nothing from the newest scan: it was a rehearsal."""
        self.perception.forget_newest()
        self.plausibility.forget_newest()

    def retry_own_laws(self) -> None:
        """Make own laws with a fault anew."""
        for runner in self.runners:
            runner.retry()


def recovery_settings(safety: SweptSafetySettings) -> RecoverySettings:
    """Return the settings of the recovery: without tries where the car must not back out."""
    return safety.recovery if safety.backs_out else safety.recovery.model_copy(update={"tries": 0})


def _driver(settings: WallFollowSettings, parts: Parts) -> Driver:
    return FOLLOWERS[_key(settings.method)](settings, parts)


def _swept(safety: SafetySettings) -> SweptSafetySettings:
    """Return the settings of the car's own guard: the default ones where the law has none for it."""
    return safety if SAFETY[_key(safety.method)].recovers else SweptSafetySettings()  # type: ignore[return-value]
