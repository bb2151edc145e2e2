"""A follower of the user behind the interface of every follower."""

import math

import numpy as np

from wallride.drivers.api import Clock, Drive, MotorState, Scan
from wallride.runtime.control.guidance import Driver, Guidance, Promise
from wallride.runtime.control.own_laws.answer import WrongAnswerError, number, of_kind, shown, text
from wallride.runtime.control.own_laws.api import LawGuidance
from wallride.runtime.control.own_laws.law_class import LawClass
from wallride.runtime.control.own_laws.runner import LawRunner, scan_for_law, state_for_law
from wallride.runtime.control.own_laws.settings import OwnFollowSettings
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.perception import Perception
from wallride.runtime.control.vehicle import CarSettings

MARGIN_M = 0.1
"""Distance from its promises that a law of the user is given; what safety measures beyond it counts."""
Path = tuple[Floats, Floats]
"""Places (2, n) [m] and speeds (n,) [m/s] of a promise."""


class OwnFollower(Driver):
    """Asks the user's law for each scan; a fault is a standstill with the fault as its reason."""

    def __init__(
        self, law: LawClass, settings: OwnFollowSettings, car: CarSettings, perception: Perception, clock: Clock | None
    ) -> None:
        self.runner = LawRunner(law, settings.own, car, clock)
        self._settings = settings
        self._perception = perception

    def tune(self, settings: OwnFollowSettings) -> None:
        """Change the settings; the law keeps its state."""
        self._settings = settings
        self.runner.tune(settings.own)

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan."""
        settings, runner = self._settings, self.runner
        percept = self._perception.look(scan, motor)
        state = state_for_law(percept, settings)
        answer = runner.call(scan_for_law(percept.view), state, settings.budget_s, _read)
        if answer is None:
            return Guidance(None, math.nan, math.nan, math.nan, runner.fault)
        drive, distance_m, reason, path = answer
        error_m = distance_m - settings.desired_distance_m
        promise = Promise(*path, MARGIN_M, scan.stamp_s) if path is not None else None
        return Guidance(drive, distance_m, error_m, math.nan, reason or runner.law.name, promise=promise)


def _read(answer: object) -> tuple[Drive, float, str, Path | None]:
    """Return what a law answered: drive, distance to the wall, reason, and the path that it promises."""
    guidance = of_kind(answer, LawGuidance, "Guidance")
    distance_m, reason = guidance.distance_m, text(guidance.reason, "reason")
    speed_mps = _finite(guidance.speed_mps, "speed_mps")
    steering_rad = _finite(guidance.steering_rad, "steering_rad")
    if not math.isfinite(plain_m := number(distance_m)) and not _is_nan(distance_m):
        raise WrongAnswerError(f"returned distance_m = {shown(distance_m)}, which is no number")
    return Drive(speed_mps, steering_rad), plain_m, reason, _path(guidance.path_m, guidance.path_mps)


def _path(path_m: object, path_mps: object) -> Path | None:
    """Return copies of a promised path and its speeds; safety judges what they are worth."""
    if path_m is None and path_mps is None:
        return None
    try:
        places_m, speeds_mps = np.array(path_m, np.float64), np.array(path_mps, np.float64)
    except (TypeError, ValueError, OverflowError):
        places_m = speeds_mps = np.empty(0)
    if places_m.ndim != 2 or places_m.shape[0] != 2 or speeds_mps.shape != places_m.shape[1:]:
        raise WrongAnswerError("returned path_m and path_mps that are not the numbers of (2, n) places and (n,) speeds")
    return places_m, speeds_mps


def _finite(value: object, name: str) -> float:
    if not math.isfinite(plain := number(value)):
        raise WrongAnswerError(f"returned {name} = {shown(value)}, which is no finite number")
    return plain


def _is_nan(value: object) -> bool:
    """Tell whether a value is a number that is not known."""
    return isinstance(value, float | np.floating) and math.isnan(value)
