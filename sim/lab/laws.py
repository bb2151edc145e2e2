"""The laws under test by name. The one place of the lab that knows how they are made.

"ball" is a follower with the safety that belongs to it; "ball+report" names both; "report+none" drives without safety.
"""

from runtime.car_settings import CarSettings
from runtime.control import methods
from runtime.control.ball import BallFollower
from runtime.control.ball_settings import BallSettings
from runtime.control.guidance import Follower, Guard
from runtime.control.perception import Eyes
from runtime.control.report_settings import ReportFollowSettings, ReportSafetySettings
from runtime.control.swept import SweptGuard
from runtime.control.swept_settings import SweptSettings
from sim.pose import Side

GUARD_OF = {"report": "report", "ball": "swept"}
"""Every follower, and the guard that it has on the car."""
GUARDS = ("report", "swept", "none")


def check(law: str) -> str:
    """Return the law's full name "follower+guard"; ValueError when there is none of that name."""
    follower, _, guard = law.partition("+")
    if follower not in GUARD_OF or (guard or GUARD_OF[follower]) not in GUARDS:
        raise ValueError(
            f"no law is called {law!r}; write one of {', '.join(GUARD_OF)},"
            f" or with another safety FOLLOWER+GUARD, guards being {', '.join(GUARDS)}"
        )
    return f"{follower}+{guard or GUARD_OF[follower]}"


def build(law: str, side: Side, desired_m: float, speed_mps: float) -> tuple[Follower, Guard | None]:
    """Return fresh laws, as they come out of the car's settings but for side, distance and speed."""
    follower_name, _, guard_name = check(law).partition("+")
    car = CarSettings()
    eyes = Eyes(car)  # one pair for both: they look at the same scan
    return _follower(follower_name, car, eyes, side, desired_m, speed_mps), _guard(guard_name, car, eyes)


def _follower(name: str, car: CarSettings, eyes: Eyes, side: Side, desired_m: float, speed_mps: float) -> Follower:
    if name == "ball":
        return BallFollower(BallSettings(side=side, desired_distance_m=desired_m, speed_mps=speed_mps), car, eyes)
    return methods.follower(ReportFollowSettings(side=side, desired_distance_m=desired_m, speed_mps=speed_mps), car)


def _guard(name: str, car: CarSettings, eyes: Eyes) -> Guard | None:
    if name == "swept":
        return SweptGuard(SweptSettings(), car, eyes)
    return methods.guard(ReportSafetySettings(), car) if name == "report" else None
