"""A follower of the user behind the interface of every follower."""

import math

from drivers.api import Clock, Drive, MotorState, Scan
from runtime.control.guidance import Guidance
from runtime.control.own_laws.api import LawGuidance
from runtime.control.own_laws.law_class import LawClass
from runtime.control.own_laws.runner import (
    MAX_REASON,
    LawRunner,
    StateReader,
    is_nan,
    is_number,
    is_text,
    kind_of_answer,
    scan_for_law,
    shown_value,
)
from runtime.control.own_laws.settings import OwnFollowSettings
from runtime.control.perception.geometry import Floats
from runtime.control.perception.view import PerceptionCache
from runtime.control.vehicle import CarSettings


class OwnFollower:
    """Asks the user's law for each scan; a fault is a standstill with the fault as its reason."""

    path_m: Floats | None = None
    """It plans no path."""

    def __init__(
        self, law: LawClass, settings: OwnFollowSettings, car: CarSettings, eyes: PerceptionCache, clock: Clock | None
    ) -> None:
        self.runner = LawRunner(law, settings.own, car, clock)
        self._settings = settings
        self._eyes = eyes
        self._state = StateReader(car)

    def tune(self, settings: OwnFollowSettings) -> None:
        """Change the settings; the law keeps its state."""
        self._settings = settings
        self.runner.tune(settings.own)

    def follow(self, scan: Scan, motor: MotorState | None) -> Guidance:
        """Answer one scan."""
        settings, runner = self._settings, self.runner
        state = self._state.read(motor, settings)
        answer = runner.call(scan_for_law(self._eyes.see(scan)), state, settings.budget_s)
        if not runner.fault:
            self._check(answer)
        if runner.fault:
            return Guidance(None, math.nan, math.nan, math.nan, runner.fault)
        distance_m = float(answer.distance_m)
        error_m = distance_m - settings.desired_distance_m
        drive = Drive(float(answer.speed_mps), float(answer.steering_rad))
        return Guidance(drive, distance_m, error_m, math.nan, answer.reason[:MAX_REASON] or runner.law.name)

    def _check(self, answer: object) -> None:
        """Take an answer of the wrong type, or without numbers, as a fault."""
        if not isinstance(answer, LawGuidance):
            self.runner.refuse(f"returned {kind_of_answer(answer)} where a Guidance is needed")
            return
        for name in ("speed_mps", "steering_rad"):
            if not is_number(value := getattr(answer, name)):
                self.runner.refuse(f"returned {name} = {shown_value(value)}, which is no finite number")
                return
        if not (is_number(answer.distance_m) or is_nan(answer.distance_m)):
            self.runner.refuse(f"returned distance_m = {shown_value(answer.distance_m)}, which is no number")
        elif not is_text(answer.reason):
            self.runner.refuse(f"returned reason = {shown_value(answer.reason)}, which is no text")
