"""Who may move the car, and how fast: voices, their words, and the one function that decides between them.

A voice either *drives* (teleop, navigation) or *caps* the speed of everyone less urgent (e-stop, safety, permit).
"I looked and it is fine" is a cap of infinity, which is not the same as silence. No queue, no clock and no I/O here:
a table of cases tests it completely.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Protocol

from drivers.api import Drive
from drivers.value import value

NO_LIMIT_MPS = math.inf
NO_WINNER = "nobody"
"""In place of a source's name in status, diagnostics and logs, where no source decided."""


class Source(StrEnum):
    """Everyone who has a say; the values are the names in `mux.order` and on the wire."""

    ESTOP = "e-stop"
    TELEOP = "teleop"
    SAFETY = "safety"
    PERMIT = "permit"
    NAVIGATION = "navigation"


LAB_ORDER = (Source.ESTOP, Source.TELEOP, Source.SAFETY, Source.PERMIT, Source.NAVIGATION)
"""The lab's mux: joystick over safety over navigation, with e-stop above all and the permit below safety."""

CAPPING = frozenset({Source.ESTOP, Source.SAFETY, Source.PERMIT})
DRIVING = frozenset({Source.TELEOP, Source.NAVIGATION})


@value()
class DriveCommand:
    """A wish to move.

    scan_stamp_s: the scan it was made from, None for a human's wish. It is not obeyed under a verdict on an older one.
    """

    source: Source
    drive: Drive
    scan_stamp_s: float | None
    reason: str


@value()
class Verdict:
    """How fast one particular drive may go. What is negative or NaN is no limit: `arbitrate` makes a stop of it.

    forward_mps, reverse_mps: ceilings, both >= 0; infinity is consent, 0 is stop.
    reason: constant words ("wall ahead"), so that a change of reason is an event; the number goes into `measure`.
    measure: the number behind the reason (metres of free way), NaN where there is none.
    brake_mps2: how hard a stop may brake; infinity is all there is. Less than that leaves grip for turning.
    steering_rad: where an emergency stop takes the wheels, None where it leaves them to the driver. Nothing but a stop
        of a car that was to move is obeyed in this.
    """

    forward_mps: float
    reverse_mps: float
    reason: str
    measure: float = math.nan
    brake_mps2: float = math.inf
    steering_rad: float | None = None

    def limit(self, speed_mps: float, steering_rad: float) -> "Verdict":  # noqa: ARG002 - the same whatever is asked
        """Be an Outlook that judges every drive alike."""
        return self


class SafetyAssessment(Protocol):
    """What a capping voice makes of the present; asked about the very drive that is about to be sent."""

    def limit(self, speed_mps: float, steering_rad: float) -> Verdict:
        """Judge a wish of any source. Cheap: asked again at every tick."""
        ...


@value()
class SpeedLimit:
    """A ceiling on the speed of everyone less urgent.

    outlook: judges the drive; a plain Verdict judges all alike.
    scan_stamp_s: the scan behind it, None where no scan is involved.
    """

    source: Source
    outlook: SafetyAssessment
    scan_stamp_s: float | None = None


def consent(source: Source, reason: str) -> SpeedLimit:
    """Return the word of a voice that does not object."""
    return SpeedLimit(source, Verdict(NO_LIMIT_MPS, NO_LIMIT_MPS, reason))


def refusal(source: Source, reason: str) -> SpeedLimit:
    """Return the word of a voice that wants the car to stand."""
    return SpeedLimit(source, Verdict(0.0, 0.0, reason))


Word = DriveCommand | SpeedLimit


@value()
class Decision:
    """What goes to the output, and why.

    speed_mps: 0.0 is a stop that brakes.
    steering_rad: None means "hold the wheels where they are", because no source steers.
    driver: the source of the wish; None without one.
    winner: who decided the speed: the voice that capped it if one did, else the driver; None for a stop by default.
    measure: the number behind the reason (metres to the obstacle), NaN where there is none.
    brake_mps2: how hard a stop may brake; infinity is all there is.
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
    """What went to the motor, and why.

    delivered: False when there was no motor to take it.
    """

    stamp_s: float
    drive: Drive
    decision: Decision
    delivered: bool


def arbitrate(live: Sequence[Word], required: frozenset[Source], order: Sequence[Source]) -> Decision:
    """Let the most urgent drive win under the caps of everyone more urgent.

    live: words in force, most urgent first, in the order of `order`.
    required: sources without which no less urgent source moves the car; a silent safety task is no consent.
    order: all voices, most urgent first; tells whether a silent voice would have bound the driver.
    """
    caps: list[SpeedLimit] = []
    for word in live:
        if isinstance(word, DriveCommand):
            return _drive_under_caps(word, caps, required.intersection(order[: order.index(word.source)]))
        caps.append(word)
    for cap in caps:
        verdict = cap.outlook.limit(0.0, 0.0)
        if verdict.forward_mps <= 0 and verdict.reverse_mps <= 0:
            return Decision(0.0, None, None, cap.source, verdict.reason, verdict.measure)
    return Decision(0.0, None, None, None, "no word from teleop or navigation")


def _drive_under_caps(word: DriveCommand, caps: Sequence[SpeedLimit], required: frozenset[Source]) -> Decision:
    steering_rad = word.drive.steering_rad
    if not (math.isfinite(word.drive.speed_mps) and math.isfinite(steering_rad)):
        return Decision(0.0, None, word.source, None, f"{word.source} asked for something that is not a number")
    missing = required - {cap.source for cap in caps}
    if missing:
        return Decision(0.0, steering_rad, word.source, None, f"no word from {min(missing)}")
    if word.scan_stamp_s is not None:
        for cap in caps:
            if cap.scan_stamp_s is not None and cap.scan_stamp_s < word.scan_stamp_s:
                return Decision(0.0, steering_rad, word.source, None, f"{cap.source} has not judged this scan yet")
    return _tightest(word, caps)


def _tightest(word: DriveCommand, caps: Sequence[SpeedLimit]) -> Decision:
    steering_rad = word.drive.steering_rad
    decision = Decision(word.drive.speed_mps, steering_rad, word.source, word.source, word.reason)
    for cap in caps:
        verdict = cap.outlook.limit(word.drive.speed_mps, steering_rad)
        if not (verdict.forward_mps >= 0 and verdict.reverse_mps >= 0 and verdict.brake_mps2 >= 0):  # NaN is not
            return Decision(0.0, steering_rad, word.source, cap.source, f"{cap.source} answers with what is no limit")
        allowed_mps = max(-verdict.reverse_mps, min(verdict.forward_mps, decision.speed_mps))
        if allowed_mps != decision.speed_mps:
            wheels_rad = _wheels_rad(verdict, allowed_mps, steering_rad)
            decision = Decision(
                allowed_mps, wheels_rad, word.source, cap.source, verdict.reason, verdict.measure, verdict.brake_mps2
            )
    return decision


def _wheels_rad(verdict: Verdict, allowed_mps: float, wish_rad: float) -> float:
    """Return where the wheels go: an emergency stop may take them from the driver, and nothing else may."""
    if verdict.steering_rad is None or allowed_mps != 0.0 or not math.isfinite(verdict.steering_rad):
        return wish_rad
    return verdict.steering_rad
