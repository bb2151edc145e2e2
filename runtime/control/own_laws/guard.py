"""Safety laws under the car's own guard: of both limits the lower one holds.

A law of the user stands under the whole guard; the report's, which is a baseline, under the limit of sensing alone.
"""

from dataclasses import dataclass, replace

from wallride.drivers.api import Clock, MotorState, Scan
from wallride.runtime.arbitration.command import Verdict
from wallride.runtime.arbitration.promise import Promise
from wallride.runtime.control.own_laws.answer import WrongAnswerError, number, of_kind, shown, text
from wallride.runtime.control.own_laws.api import LawLimit
from wallride.runtime.control.own_laws.law_class import LawClass
from wallride.runtime.control.own_laws.runner import LawRunner, OwnSection, WantedDrive, scan_for_law, state_for_law
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.report.laws import ReportGuard
from wallride.runtime.control.report.settings import ReportSafetySettings
from wallride.runtime.control.safety.swept import SweptAssessment, SweptGuard
from wallride.runtime.control.safety.swept_memory import SweptMemory


@dataclass(slots=True, eq=False)
class _Guarded:
    """The assessment of the car's own guard; its memory is the only one."""

    assessment: SweptAssessment

    @property
    def view(self) -> View:
        """Return the view of the judged scan."""
        return self.assessment.view

    @property
    def memory(self) -> SweptMemory:
        """Return the guard's memory."""
        return self.assessment.memory

    def commit(self, memory: SweptMemory) -> None:
        """Take over the memory after a command that was sent."""
        self.assessment.commit(memory)


@dataclass(slots=True, eq=False)
class CappedAssessment(_Guarded):
    """The assessment of the car's own guard, under the limit of an own law."""

    cap: Verdict

    def judge(
        self, speed_mps: float, steering_rad: float, memory: SweptMemory, promise: Promise | None = None
    ) -> tuple[Verdict, SweptMemory]:
        """Judge a drive: the lower limit of both in each direction, with the reason of the one that binds."""
        verdict, memory = self.assessment.judge(speed_mps, steering_rad, memory, promise)
        return _lower_of(verdict, self.cap, speed_mps), memory

    def ask(self, speed_mps: float, steering_rad: float) -> Verdict:
        """Return what `judge` would, without a trace."""
        return _lower_of(self.assessment.ask(speed_mps, steering_rad), self.cap, speed_mps)


@dataclass(slots=True, eq=False)
class GuardedAssessment(_Guarded):
    """The verdict of the report's law, under the limit of sensing of the car's own guard."""

    verdict: Verdict

    def judge(
        self,
        speed_mps: float,
        steering_rad: float,
        memory: SweptMemory,
        promise: Promise | None = None,  # noqa: ARG002
    ) -> tuple[Verdict, SweptMemory]:
        """Judge a drive; it leaves nothing in the memory."""
        return self.ask(speed_mps, steering_rad), memory

    def ask(self, speed_mps: float, steering_rad: float) -> Verdict:
        """Judge a drive: the report's verdict, unless sensing allows less."""
        return _lower_of(self.verdict, self.assessment.limit_of_sensing(speed_mps, steering_rad), speed_mps)


class GuardedReport:
    """The report's law under the car's own guard, which tells how far the lidar can be trusted."""

    def __init__(self, guard: SweptGuard, settings: ReportSafetySettings) -> None:
        self.guard = guard
        self.law = ReportGuard(guard.car, settings)

    def look(self, scan: Scan, motor: MotorState | None) -> GuardedAssessment:
        """Process one scan."""
        return GuardedAssessment(self.guard.look(scan, motor), self.law.look(scan, motor))

    def learn(self) -> None:
        """Run the deferred work of the car's own guard."""
        self.guard.learn()


class CappedGuard:
    """Asks the car's own guard and then the user's law; a fault of the law is a stop with the fault as its reason."""

    def __init__(
        self, guard: SweptGuard, law: LawClass, settings: OwnSection, wanted: WantedDrive, clock: Clock | None
    ) -> None:
        self.guard = guard
        self.runner = LawRunner(law, settings.own, guard.car, clock)
        self._settings, self._wanted = settings, wanted

    def tune(self, settings: OwnSection, wanted: WantedDrive) -> None:
        """Change the settings; the law keeps its state."""
        self._settings, self._wanted = settings, wanted
        self.runner.tune(settings.own)

    def look(self, scan: Scan, motor: MotorState | None) -> CappedAssessment:
        """Process one scan."""
        assessment = self.guard.look(scan, motor)
        state = state_for_law(assessment.percept, self._wanted)
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


def _lower_of(verdict: Verdict, cap: Verdict, speed_mps: float) -> Verdict:
    """Return the lower limit in each direction, with the reason of the one that binds: of equal ones the first."""
    if cap.forward_mps >= verdict.forward_mps and cap.reverse_mps >= verdict.reverse_mps:
        return verdict
    binds = cap.reverse_mps < verdict.reverse_mps if speed_mps < 0 else cap.forward_mps < verdict.forward_mps
    return replace(
        cap if binds else verdict,
        forward_mps=min(cap.forward_mps, verdict.forward_mps),
        reverse_mps=min(cap.reverse_mps, verdict.reverse_mps),
    )
