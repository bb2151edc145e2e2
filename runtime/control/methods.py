"""Selection of the laws by name, by `wall_follow.method` and `safety.method`."""

from collections.abc import Callable

from drivers.api import Clock
from runtime.control.guidance import Follower, Guard
from runtime.control.method_settings import SafetySettings, SweptSafetySettings, WallFollowSettings
from runtime.control.perception.view import PerceptionCache
from runtime.control.recovery.recovering_follower import RecoveringFollower
from runtime.control.recovery.way_out import Recovery
from runtime.control.report.laws import ReportFollower, ReportGuard, ReportTurn
from runtime.control.safety.swept import SweptGuard
from runtime.control.safety.swept_settings import RecoverySettings
from runtime.control.vehicle import CarSettings
from runtime.control.wall_following.ball import BallFollower

Driver = BallFollower | ReportFollower


def laws(
    wall_follow: WallFollowSettings, safety: SafetySettings, car: CarSettings, clock: Clock | None = None
) -> tuple[Follower, Guard]:
    """Return the follower and the safety law that the settings name; they share one `PerceptionCache`.

    clock: lets safety measure the age of its scan at every judgement; None takes it as it was on arrival.
    """
    eyes = PerceptionCache(car)
    driver = driver_for(wall_follow, car, eyes)
    guard = guard_for(safety, car, eyes, clock)
    recovery = recovery_for(safety)
    return wrapped(driver, guard, recovery, wall_follow), guard


def driver_for(wall_follow: WallFollowSettings, car: CarSettings, eyes: PerceptionCache) -> Driver:
    """Return the follower itself, without the recovery."""
    match wall_follow.method:
        case "ball":
            return BallFollower(wall_follow, car, eyes)
        case "report":
            return ReportFollower(wall_follow)


def guard_for(
    safety: SafetySettings, car: CarSettings, eyes: PerceptionCache, clock: Clock | None
) -> SweptGuard | ReportGuard:
    """Return the safety law."""
    if isinstance(safety, SweptSafetySettings):
        return SweptGuard(safety, car, eyes, health=safety.window, clock=clock)
    return ReportGuard(car, safety)


def recovery_for(safety: SafetySettings) -> Recovery | None:
    """Return the recovery, which only asks for help where the settings forbid a way out; None without `swept`."""
    return Recovery(recovery_settings(safety)) if isinstance(safety, SweptSafetySettings) else None


def recovery_settings(safety: SweptSafetySettings) -> RecoverySettings:
    """Return the settings of the recovery: without tries where the car must not back out."""
    return safety.recovery if safety.backs_out else safety.recovery.model_copy(update={"tries": 0})


def wrapped(
    driver: Follower,
    guard: SweptGuard | ReportGuard,
    recovery: Recovery | None,
    wall_follow: WallFollowSettings,
    believed: Callable[[], bool] = lambda: True,
) -> Follower:
    """Return the follower with what its safety law adds to it: the way out of a corner, or the report's turn.

    believed: whether the odometry is good enough to back out by.
    """
    if isinstance(guard, ReportGuard):
        return ReportTurn(driver, guard, wall_follow.side)
    return RecoveringFollower(driver, guard, recovery, believed) if recovery is not None else driver
