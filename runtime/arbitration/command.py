"""Command sources, their commands and speed limits, and the pure function that arbitrates between them.

A source either *drives* (teleop, navigation) or *limits* the speed of every less urgent source (e-stop, battery, motor,
safety, permit). "Checked, no objection" is a limit of infinity, which is not the same as silence. No queue, no clock
and no I/O here: a table of cases tests it completely.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Any, ClassVar, Protocol

from wallride.drivers.api import Drive
from wallride.drivers.value import value
from wallride.runtime.arbitration.promise import Promise

NO_LIMIT_MPS = math.inf
NO_WINNER = "nobody"
"""Name in status, diagnostics and logs where no source decided."""


class Source(StrEnum):
    """The command sources; the values are the names in `mux.order` and on the wire."""

    ESTOP = "e-stop"
    BATTERY = "battery"
    MOTOR = "motor"
    TELEOP = "teleop"
    SAFETY = "safety"
    PERMIT = "permit"
    PLANNER = "planner"
    PLANNER_HOLD = "planner hold"
    NAVIGATION = "navigation"


LAB_ORDER = (Source.ESTOP, Source.TELEOP, Source.SAFETY, Source.PERMIT, Source.NAVIGATION)
"""The lab's priority order: joystick over safety over navigation, with e-stop above all and the permit below safety.

Battery, motor and planners are no part of it: the battery's place is behind the e-stop, a motor's that bounds the speed
behind that, that of planners and of what keeps the follower from driving in a planner's place before navigation
(`Settings.effective_order`)."""

DRIVING = frozenset({Source.TELEOP, Source.PLANNER, Source.NAVIGATION})


@value()
class DriveCommand:
    """A requested motion.

    scan_stamp_s: the scan it was computed from, None for a human's request. It is not obeyed under a verdict on an
        older scan.
    stuck: whether the source has no way out of where the car stands: its reason then stands for that of safety.
    promise: the path that the source will drive, in base_link at that scan; None where it promises none.
    """

    source: Source
    drive: Drive
    scan_stamp_s: float | None
    reason: str
    stuck: bool = False
    promise: Promise | None = None


@value()
class Verdict:
    """Speed limits for one particular drive command.

    A negative or NaN limit is invalid: `arbitrate` turns it into a stop.

    forward_mps, reverse_mps: ceilings, both >= 0; infinity is consent, 0 is stop.
    reason: constant text ("wall ahead"), so that a change of reason is an event; the number goes into `measure`.
    measure: the number behind the reason (metres of free way), NaN where there is none.
    brake_mps2: maximum deceleration of a stop; infinity is full braking. Less than that leaves grip for turning.
    steering_rad: steering angle of an emergency stop, None where the driver keeps the steering. It is obeyed only in a
        stop of a car that was commanded to move.
    stands: whether the car stands before what is in the way.
    """

    forward_mps: float
    reverse_mps: float
    reason: str
    measure: float = math.nan
    brake_mps2: float = math.inf
    steering_rad: float | None = None
    stands: bool = False

    memory: ClassVar[None] = None

    def judge(
        self,
        speed_mps: float,  # noqa: ARG002
        steering_rad: float,  # noqa: ARG002
        memory: Any,  # noqa: ANN401
        promise: Promise | None = None,  # noqa: ARG002
    ) -> tuple["Verdict", Any]:
        """Return this verdict for every command: a constant SafetyAssessment."""
        return self, memory

    def ask(self, speed_mps: float, steering_rad: float) -> "Verdict":  # noqa: ARG002 - the same whatever is asked
        """Return this verdict."""
        return self

    def commit(self, memory: Any) -> None:  # noqa: ANN401
        """Remember nothing."""


class SafetyAssessment(Protocol):
    """Judgement of the present by a limiting source; evaluated for the very command that is about to be sent.

    memory: a value, what the commands that were sent have left in the law; None where they leave nothing.
    """

    @property
    def memory(self) -> Any: ...  # noqa: ANN401, D102 - in the class docstring

    def judge(
        self,
        speed_mps: float,
        steering_rad: float,
        memory: Any,  # noqa: ANN401
        promise: Promise | None = None,
    ) -> tuple[Verdict, Any]:
        """Return the verdict on a command that is about to be sent, and the memory after it; commits nothing.

        Cheap: evaluated again at every tick. promise: the path that its source will drive.
        """

    def ask(self, speed_mps: float, steering_rad: float) -> Verdict:
        """Return the verdict that `judge` would; changes not even a cache that a later judgement reads."""

    def commit(self, memory: Any) -> None:  # noqa: ANN401
        """Take over the memory after a command that was sent: for the mux alone."""


Memories = Sequence[tuple[SafetyAssessment, Any]]
"""What a decision leaves behind: each assessment that judged it, with the memory to commit."""


@value()
class SpeedLimit:
    """A limit on the speed of every less urgent source.

    assessment: judges the command; a plain Verdict judges all alike.
    scan_stamp_s: the scan behind it, None where no scan is involved.
    """

    source: Source
    assessment: SafetyAssessment
    scan_stamp_s: float | None = None


def consent(source: Source, reason: str) -> SpeedLimit:
    """Return the speed limit of a source that does not object."""
    return SpeedLimit(source, Verdict(NO_LIMIT_MPS, NO_LIMIT_MPS, reason))


def refusal(source: Source, reason: str) -> SpeedLimit:
    """Return the speed limit of a source that requests a stop."""
    return SpeedLimit(source, Verdict(0.0, 0.0, reason))


QueueEntry = DriveCommand | SpeedLimit


@value()
class Decision:
    """The command for the output, and its reason.

    speed_mps: 0.0 is a stop that brakes.
    steering_rad: None means "hold the present steering angle", because no source steers.
    driver: the source of the drive command; None without one.
    winner: the source that decided the speed: the one that limited it if any did, else the driver; None for a stop by
        default.
    measure: the number behind the reason (metres to the obstacle), NaN where there is none.
    brake_mps2: maximum deceleration of a stop; infinity is full braking.
    """

    speed_mps: float
    steering_rad: float | None
    driver: Source | None
    winner: Source | None
    reason: str
    measure: float = math.nan
    brake_mps2: float = math.inf


@value()
class Output:
    """The command that was sent to the motor, and its reason.

    delivered: False when no motor was there to receive it.
    braked: the motor's driver wrote a brake in its place.
    """

    stamp_s: float
    drive: Drive
    decision: Decision
    delivered: bool
    braked: bool = False


def arbitrate(
    live: Sequence[QueueEntry], required: frozenset[Source], order: Sequence[Source]
) -> tuple[Decision, Memories]:
    """Select the most urgent drive command, limited by every more urgent source; changes nothing.

    The memories are those that the mux commits once the command is sent.

    live: commands and limits in force, most urgent first, in the order of `order`.
    required: sources without which no less urgent source moves the car; a silent safety task is no consent.
    order: all sources, most urgent first; determines whether a silent source would have bound the driver.
    """
    caps: list[SpeedLimit] = []
    for word in live:
        if isinstance(word, DriveCommand):
            return _drive_under_caps(word, caps, required.intersection(order[: order.index(word.source)]))
        caps.append(word)
    for cap in caps:
        verdict, _ = cap.assessment.judge(0.0, 0.0, cap.assessment.memory)  # nothing is sent: nothing to commit
        if verdict.forward_mps <= 0 and verdict.reverse_mps <= 0:
            return Decision(0.0, None, None, cap.source, verdict.reason, verdict.measure), ()
    return Decision(0.0, None, None, None, "no word from teleop or navigation"), ()


def _drive_under_caps(
    word: DriveCommand, caps: Sequence[SpeedLimit], required: frozenset[Source]
) -> tuple[Decision, Memories]:
    steering_rad = word.drive.steering_rad
    if not (math.isfinite(word.drive.speed_mps) and math.isfinite(steering_rad)):
        return Decision(0.0, None, word.source, None, f"{word.source} asked for something that is not a number"), ()
    missing = required - {cap.source for cap in caps}
    if missing:
        return Decision(0.0, steering_rad, word.source, None, f"no word from {min(missing)}"), ()
    if word.scan_stamp_s is not None:
        for cap in caps:
            if cap.scan_stamp_s is not None and cap.scan_stamp_s < word.scan_stamp_s:
                return Decision(0.0, steering_rad, word.source, None, f"{cap.source} has not judged this scan yet"), ()
    return _tightest(word, caps)


def _tightest(word: DriveCommand, caps: Sequence[SpeedLimit]) -> tuple[Decision, Memories]:
    steering_rad, memories = word.drive.steering_rad, []
    decision = Decision(word.drive.speed_mps, steering_rad, word.source, word.source, word.reason)
    for cap in caps:
        assessment = cap.assessment
        verdict, memory = assessment.judge(word.drive.speed_mps, steering_rad, assessment.memory, word.promise)
        memories.append((assessment, memory))
        if not (verdict.forward_mps >= 0 and verdict.reverse_mps >= 0 and verdict.brake_mps2 >= 0):  # false for NaN
            no_limit = f"{cap.source} answers with what is no limit"
            return Decision(0.0, steering_rad, word.source, cap.source, no_limit), memories
        allowed_mps = max(-verdict.reverse_mps, min(verdict.forward_mps, decision.speed_mps))
        if allowed_mps != decision.speed_mps:
            wheels_rad = _wheels_rad(verdict, allowed_mps, steering_rad)
            reason = word.reason if word.stuck and verdict.stands else verdict.reason
            decision = Decision(
                allowed_mps, wheels_rad, word.source, cap.source, reason, verdict.measure, verdict.brake_mps2
            )
    return decision, memories


def _wheels_rad(verdict: Verdict, allowed_mps: float, wish_rad: float) -> float:
    """Return the steering angle: an emergency stop may override the driver's, and nothing else may."""
    if verdict.steering_rad is None or allowed_mps != 0.0 or not math.isfinite(verdict.steering_rad):
        return wish_rad
    return verdict.steering_rad
