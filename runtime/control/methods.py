"""The laws by name, as `wall_follow.method` and `safety.method` choose them."""

import math

import numpy as np

from drivers.api import Scan
from runtime.car_settings import CarSettings
from runtime.control.guidance import Follower, Guard
from runtime.control.report import ReportFollower, ReportGuard
from runtime.control.report_settings import ReportFollowSettings, ReportSafetySettings


def follower(settings: ReportFollowSettings, car: CarSettings) -> Follower:  # noqa: ARG001 - other methods need the car
    """Return the follower that the settings name."""
    match settings.method:
        case "report":
            return ReportFollower(settings)


def guard(settings: ReportSafetySettings, car: CarSettings) -> Guard:
    """Return the safety law that the settings name."""
    match settings.method:
        case "report":
            return ReportGuard(car)


def warm_up(follower: Follower, guard: Guard) -> None:
    """Run one synthetic scan through both: the first call of a numpy routine is slower than all later ones."""
    beams = 1081
    step_rad = math.radians(0.25)
    scan = Scan(0.0, 0.0, -step_rad * (beams // 2), step_rad, 0.02, 30.0, np.full(beams, 2.0, np.float32), 0)
    guard.look(scan, None).limit(1.0, 0.0)
    follower.follow(scan, None)
