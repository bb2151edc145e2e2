"""Selection of the laws by name, by `wall_follow.method` and `safety.method`."""

from collections.abc import Callable

from wallride.drivers.api import Clock
from wallride.runtime.control.guidance import Follower, Guard
from wallride.runtime.control.method_settings import (
    BallFollowSettings,
    OwnSafetySettings,
    SafetySettings,
    SweptSafetySettings,
    WallFollowSettings,
)
from wallride.runtime.control.own_laws.follower import OwnFollower
from wallride.runtime.control.own_laws.guard import CappedGuard, GuardedReport
from wallride.runtime.control.own_laws.law_class import load_law
from wallride.runtime.control.own_laws.runner import LawRunner
from wallride.runtime.control.own_laws.settings import OwnFollowSettings
from wallride.runtime.control.perception.view import PerceptionCache
from wallride.runtime.control.recovery.recovering_follower import RecoveringFollower
from wallride.runtime.control.recovery.way_out import Recovery
from wallride.runtime.control.report.laws import ReportFollower, ReportTurn
from wallride.runtime.control.report.settings import ReportFollowSettings, ReportSafetySettings
from wallride.runtime.control.safety.swept import SweptGuard
from wallride.runtime.control.safety.swept_settings import RecoverySettings
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.ball import BallFollower

Driver = BallFollower | ReportFollower | OwnFollower
Judge = SweptGuard | CappedGuard | GuardedReport


def laws(
    wall_follow: WallFollowSettings, safety: SafetySettings, car: CarSettings, clock: Clock | None = None
) -> tuple[Follower, Guard]:
    """Return the follower and the safety law that the settings name; they share one `PerceptionCache`.

    clock: lets safety measure the age of its scan at every judgement; None takes it as it was on arrival.
    """
    eyes = PerceptionCache(car)
    driver = driver_for(wall_follow, car, eyes, clock)
    judge = judge_for(guard_for(safety, car, eyes, clock), safety, wall_follow, clock)
    return wrapped(driver, judge, recovery_for(safety), wall_follow), judge


def driver_for(
    wall_follow: WallFollowSettings, car: CarSettings, eyes: PerceptionCache, clock: Clock | None = None
) -> Driver:
    """Return the follower itself, without the recovery. clock: measures the answers of an own law."""
    match wall_follow:
        case BallFollowSettings():
            return BallFollower(wall_follow, car, eyes)
        case ReportFollowSettings():
            return ReportFollower(wall_follow)
        case _:
            return OwnFollower(load_law("wall_follow", wall_follow.method), wall_follow, car, eyes, clock)


def own_law_mistakes(wall_follow: WallFollowSettings, safety: SafetySettings, car: CarSettings) -> list[str]:
    """Return what is wrong with making the own laws that the settings name, one sentence each."""
    named = [("wall_follow", wall_follow), ("safety", safety)]
    runners = [
        LawRunner(load_law(section, settings.method), settings.own, car, None)
        for section, settings in named
        if isinstance(settings, OwnFollowSettings | OwnSafetySettings)
    ]
    return [runner.fault for runner in runners if runner.fault]


def guard_for(safety: SafetySettings, car: CarSettings, eyes: PerceptionCache, clock: Clock | None) -> SweptGuard:
    """Return the car's own guard, which every safety law stands under."""
    swept = swept_settings(safety)
    return SweptGuard(swept, car, eyes, health=swept.window, clock=clock)


def swept_settings(safety: SafetySettings) -> SweptSafetySettings:
    """Return the settings of the car's own guard: the default ones where the report's law has none for it."""
    return SweptSafetySettings() if isinstance(safety, ReportSafetySettings) else safety


def judge_for(guard: SweptGuard, safety: SafetySettings, wall_follow: WallFollowSettings, clock: Clock | None) -> Judge:
    """Return the safety law: the guard itself, or another law under it, which can only lower its limits."""
    match safety:
        case ReportSafetySettings():
            return GuardedReport(guard, safety)
        case OwnSafetySettings():
            return CappedGuard(guard, load_law("safety", safety.method), safety, wall_follow, clock)
        case _:
            return guard


def recovery_for(safety: SafetySettings) -> Recovery | None:
    """Return the recovery, which only asks for help where the settings forbid a way out; None without `swept`."""
    return Recovery(recovery_settings(safety)) if isinstance(safety, SweptSafetySettings) else None


def recovery_settings(safety: SweptSafetySettings) -> RecoverySettings:
    """Return the settings of the recovery: without tries where the car must not back out."""
    return safety.recovery if safety.backs_out else safety.recovery.model_copy(update={"tries": 0})


def wrapped(
    driver: Follower,
    judge: Judge,
    recovery: Recovery | None,
    wall_follow: WallFollowSettings,
    believed: Callable[[], bool] = lambda: True,
) -> Follower:
    """Return the follower with what its safety law adds to it: the way out of a corner, or the report's turn.

    believed: whether the odometry is good enough to back out by.
    """
    if isinstance(judge, GuardedReport):
        return ReportTurn(driver, judge.law, wall_follow.side)
    guard = judge.guard if isinstance(judge, CappedGuard) else judge
    return RecoveringFollower(driver, guard, recovery, believed) if recovery is not None else driver
