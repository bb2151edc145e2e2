"""A safety law of the user, capped by the car's own: of both limits the lower one holds."""

from dataclasses import dataclass, replace

from drivers.api import Clock, MotorState, Scan
from runtime.arbitration.command import Verdict
from runtime.control.own_laws.answer import WrongAnswerError, number, of_kind, shown, text
from runtime.control.own_laws.api import LawLimit
from runtime.control.own_laws.law_class import LawClass
from runtime.control.own_laws.runner import LawRunner, OwnSection, StateReader, WantedDrive, scan_for_law
from runtime.control.perception.view import View
from runtime.control.safety.swept import SweptAssessment, SweptGuard


@dataclass(slots=True, eq=False)
class CappedAssessment:
    """The assessment of the car's own guard, under the limit of an own law."""

    assessment: SweptAssessment
    cap: Verdict

    @property
    def view(self) -> View:
        """Return the view of the judged scan."""
        return self.assessment.view

    def limit(self, speed_mps: float, steering_rad: float) -> Verdict:
        """Judge a drive: the lower limit of both in each direction, with the reason of the one that binds."""
        return self._capped(self.assessment.limit(speed_mps, steering_rad), speed_mps)

    def ask(self, speed_mps: float, steering_rad: float) -> Verdict:
        """Return what `limit` would, without a trace."""
        return self._capped(self.assessment.ask(speed_mps, steering_rad), speed_mps)

    def _capped(self, verdict: Verdict, speed_mps: float) -> Verdict:
        cap = self.cap
        if cap.forward_mps >= verdict.forward_mps and cap.reverse_mps >= verdict.reverse_mps:
            return verdict
        binds = cap.reverse_mps < verdict.reverse_mps if speed_mps < 0 else cap.forward_mps < verdict.forward_mps
        return replace(
            cap if binds else verdict,
            forward_mps=min(cap.forward_mps, verdict.forward_mps),
            reverse_mps=min(cap.reverse_mps, verdict.reverse_mps),
        )


class CappedGuard:
    """Asks the car's own guard and then the user's law; a fault of the law is a stop with the fault as its reason."""

    def __init__(
        self, guard: SweptGuard, law: LawClass, settings: OwnSection, wanted: WantedDrive, clock: Clock | None
    ) -> None:
        self.guard = guard
        self.runner = LawRunner(law, settings.own, guard.car, clock)
        self._settings, self._wanted = settings, wanted
        self._state = StateReader(guard.car)

    def tune(self, settings: OwnSection, wanted: WantedDrive) -> None:
        """Change the settings; the law keeps its state."""
        self._settings, self._wanted = settings, wanted
        self.runner.tune(settings.own)

    def look(self, scan: Scan, motor: MotorState | None) -> CappedAssessment:
        """Process one scan."""
        assessment = self.guard.look(scan, motor)
        state = self._state.read(motor, self._wanted)
        cap = self.runner.call(scan_for_law(assessment.view), state, self._settings.budget_s, self._read)
        return CappedAssessment(assessment, cap if cap is not None else Verdict(0.0, 0.0, self.runner.fault))

    def learn(self) -> None:
        """Run the deferred work of the car's own guard."""
        self.guard.learn()

    def _read(self, answer: object) -> Verdict:
        """Return what the law answered."""
        limit = of_kind(answer, LawLimit, "Limit")
        reason = text(limit.reason, "reason") or self.runner.law.name
        return Verdict(_limit(limit.forward_mps, "forward_mps"), _limit(limit.reverse_mps, "reverse_mps"), reason)


def _limit(value: object, name: str) -> float:
    if not (plain_mps := number(value)) >= 0:  # true for NaN
        raise WrongAnswerError(f"returned {name} = {shown(value)}, which is no speed from 0 to infinity")
    return plain_mps
