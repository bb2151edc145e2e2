"""A safety law of the user, capped by the car's own: of both limits the lower one holds."""

from dataclasses import dataclass, replace

from drivers.api import Clock, MotorState, Scan
from runtime.arbitration.command import SafetyAssessment, Verdict
from runtime.control.own_laws.api import LawLimit
from runtime.control.own_laws.law_class import LawClass
from runtime.control.own_laws.runner import (
    MAX_REASON,
    LawRunner,
    OwnSection,
    StateReader,
    WantedDrive,
    is_infinite,
    is_number,
    is_text,
    kind_of_answer,
    scan_for_law,
    shown_value,
)
from runtime.control.safety.swept import SweptGuard


@dataclass(slots=True, eq=False)
class CappedAssessment:
    """The assessment of the car's own guard, under the limit of an own law."""

    assessment: SafetyAssessment
    cap: Verdict

    def limit(self, speed_mps: float, steering_rad: float) -> Verdict:
        """Judge a drive: the lower limit of both in each direction, with the reason of the one that binds."""
        verdict, cap = self.assessment.limit(speed_mps, steering_rad), self.cap
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
        answer = self.runner.call(scan_for_law(assessment.view), state, self._settings.budget_s)
        return CappedAssessment(assessment, self._cap(answer))

    def learn(self) -> None:
        """Run the deferred work of the car's own guard."""
        self.guard.learn()

    def _cap(self, answer: object) -> Verdict:
        runner = self.runner
        if not runner.fault:
            self._check(answer)
        if runner.fault or not isinstance(answer, LawLimit):
            return Verdict(0.0, 0.0, runner.fault)
        reason = answer.reason[:MAX_REASON] or runner.law.name
        return Verdict(float(answer.forward_mps), float(answer.reverse_mps), reason)

    def _check(self, answer: object) -> None:
        """Take an answer of the wrong type, or without limits, as a fault."""
        if not isinstance(answer, LawLimit):
            self.runner.refuse(f"returned {kind_of_answer(answer)} where a Limit is needed")
            return
        for name in ("forward_mps", "reverse_mps"):
            value = getattr(answer, name)
            if not (is_number(value) or is_infinite(value)) or value < 0:
                self.runner.refuse(f"returned {name} = {shown_value(value)}, which is no speed from 0 to infinity")
                return
        if not is_text(answer.reason):
            self.runner.refuse(f"returned reason = {shown_value(answer.reason)}, which is no text")
