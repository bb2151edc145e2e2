"""The mux's decision table: one line a situation, read like a specification. Used by its test and its mutation test."""

import math
from dataclasses import dataclass, replace

from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import (
    LAB_ORDER,
    Decision,
    DriveCommand,
    QueueEntry,
    Source,
    SpeedLimit,
    Verdict,
)

INF = math.inf
NAN = math.nan
REQUIRED = frozenset({Source.SAFETY, Source.PERMIT})
BOUND_ORDER = (Source.ESTOP, Source.SAFETY, Source.TELEOP, Source.PERMIT, Source.NAVIGATION)


def nav(speed=1.0, steering=0.1, scan=1.0):
    return DriveCommand(Source.NAVIGATION, Drive(speed, steering), scan, "wall")


def stick(speed=2.0, steering=-0.2):
    return DriveCommand(Source.TELEOP, Drive(speed, steering), None, "stick")


def safety(forward=INF, reverse=INF, scan=1.0, reason="clear", measure=NAN):
    return SpeedLimit(Source.SAFETY, Verdict(forward, reverse, reason, measure), scan)


def permit(limit=INF, reason="permitted"):
    return SpeedLimit(Source.PERMIT, Verdict(limit, limit, reason))


def estop(limit=0.0):
    return SpeedLimit(Source.ESTOP, Verdict(limit, limit, "red button"))


class Counting:
    """A safety without objection; its memory is the number of commands that were sent."""

    memory = 0

    def ask(self, _speed_mps, _steering_rad):
        return Verdict(INF, INF, "clear")

    def judge(self, speed_mps, steering_rad, memory, _promise=None):
        return self.ask(speed_mps, steering_rad), memory + 1

    def commit(self, memory):
        self.memory = memory


class Bend(Counting):
    """A safety that stops whoever turns left, and lets go on whoever turns right; it brakes gently."""

    def ask(self, speed_mps, steering_rad):
        free = steering_rad < 0
        return Verdict(INF if free else 0.2 * abs(speed_mps), INF, "wall on the left", steering_rad, 3.0)


class Boxed(Counting):
    """A safety that has words only for a car that stands and does not steer."""

    def ask(self, speed_mps, steering_rad):
        stop = 0.0 if speed_mps == steering_rad == 0 else INF
        return Verdict(stop, stop, "boxed in")


def stuck():
    return replace(nav(), reason="needs help", stuck=True)


def stands():
    return SpeedLimit(Source.SAFETY, Verdict(0.0, INF, "boxed in", 0.1, stands=True), 1.0)


def boxed():
    return SpeedLimit(Source.SAFETY, Boxed(), 1.0)


def bend0():
    return SpeedLimit(Source.SAFETY, Verdict(0.0, INF, "wall", brake_mps2=0.0), 1.0)


def bend(scan=1.0):
    return SpeedLimit(Source.SAFETY, Bend(), scan)


def swerve(steering=-0.3, forward=0.0, scan=1.0):
    """An emergency stop that takes the wheels."""
    return SpeedLimit(Source.SAFETY, Verdict(forward, INF, "swerving", 0.4, 2.0, steering), scan)


@dataclass(frozen=True)
class Case:
    title: str
    live: list[QueueEntry]
    speed: float
    steering: float | None
    driver: Source | None
    winner: Source | None
    reason: str
    measure: float = NAN
    order: tuple[Source, ...] = LAB_ORDER
    required: frozenset[Source] = REQUIRED
    brake: float = INF


N, T, S, P, E = Source.NAVIGATION, Source.TELEOP, Source.SAFETY, Source.PERMIT, Source.ESTOP
OK = "wall"
SILENT = "no word from teleop or navigation"
LATE = "safety has not judged this scan yet"

CASES = [
    Case("no source has a command", [], 0, None, None, None, SILENT),
    Case("consent alone does not drive", [safety(), permit()], 0, None, None, None, SILENT),
    Case("everyone agrees", [safety(), permit(), nav()], 1, 0.1, N, N, OK),
    Case("reverse under consent", [safety(), permit(), nav(-0.5)], -0.5, 0.1, N, N, OK),
    Case("standstill is a wish too", [safety(), permit(), nav(0.0)], 0, 0.1, N, N, OK),
    # answers that are no limits
    *(
        Case(f"safety answers ({forward}, {reverse}, brake {brake})",
             [SpeedLimit(Source.SAFETY, Verdict(forward, reverse, "?", 7.0, brake), 1.0), permit(), nav(speed)],
             0, 0.1, N, S, "safety answers with what is no limit")
        for speed in (1.0, -1.0)
        for forward, reverse, brake in [
            (NAN, NAN, INF), (NAN, INF, INF), (INF, NAN, INF), (-0.1, INF, INF), (INF, -0.1, INF), (-INF, INF, INF),
            (INF, INF, NAN), (INF, INF, -1.0),
        ]
    ),
    Case("no brake at all is a limit: the bend needs all the grip", [bend0(), permit(), nav(1.0)], 0, 0.1, N, S,
         "wall", brake=0.0),
    Case("a stop by the permit stays when safety answers nonsense",
         [SpeedLimit(Source.SAFETY, Verdict(NAN, NAN, "?"), 1.0), permit(0.0, "no permit"), nav()], 0, 0.1, N, S,
         "safety answers with what is no limit"),
    # required sources
    Case("safety is silent", [permit(), nav()], 0, 0.1, N, None, "no word from safety"),
    Case("permit is silent", [safety(), nav()], 0, 0.1, N, None, "no word from permit"),
    Case("both silent: one is named, always the same", [nav()], 0, 0.1, N, None, "no word from permit"),
    Case("nobody is required", [nav()], 1, 0.1, N, N, OK, required=frozenset()),
    Case("a pressed e-stop does not replace a required voice", [estop(INF), permit(), nav()], 0, 0.1, N, None,
         "no word from safety"),
    # caps
    Case("safety stops", [safety(0.0, reason="wall ahead", measure=0.6), permit(), nav()], 0, 0.1, N, S, "wall ahead",
         0.6),
    Case("safety slows", [safety(0.4, reason="wall ahead", measure=1.2), permit(), nav()], 0.4, 0.1, N, S,
         "wall ahead", 1.2),
    Case("a looser cap changes nothing", [safety(3.0, reason="far", measure=9.0), permit(), nav()], 1, 0.1, N, N, OK),
    Case("a cap equal to the wish changes nothing", [safety(1.0, measure=9.0), permit(), nav()], 1, 0.1, N, N, OK),
    Case("a stop ahead lets the car back out", [safety(0.0, INF), permit(), nav(-0.5)], -0.5, 0.1, N, N, OK),
    Case("a stop behind lets it go ahead", [safety(INF, 0.0), permit(), nav(0.7)], 0.7, 0.1, N, N, OK),
    Case("safety slows reverse", [safety(INF, 0.2, reason="behind"), permit(), nav(-0.5)], -0.2, 0.1, N, S, "behind"),
    Case("the later, tighter of two caps wins", [safety(0.6, reason="a"), permit(0.3, "b"), nav()], 0.3, 0.1, N, P,
         "b"),
    Case("the earlier, tighter of two caps wins", [safety(0.3, reason="a"), permit(0.6, "b"), nav()], 0.3, 0.1, N, S,
         "a"),
    Case("of two equal caps the more urgent is named", [safety(0.3, reason="a"), permit(0.3, "b"), nav()], 0.3, 0.1, N,
         S, "a"),
    Case("two caps in reverse", [safety(INF, 0.4, reason="a"), permit(0.1, "b"), nav(-1.0)], -0.1, 0.1, N, P, "b"),
    Case("permit refused", [safety(), permit(0.0, "no operator"), nav()], 0, 0.1, N, P, "no operator"),
    Case("e-stop", [estop(), safety(), permit(), nav()], 0, 0.1, N, E, "red button"),
    Case("e-stop without a driver says so", [estop(), safety(), permit()], 0, None, None, E, "red button"),
    Case("e-stop holds also in reverse", [estop(), safety(), permit(), nav(-1.0)], 0, 0.1, N, E, "red button"),
    Case("a stop that nobody drives into is still the reason", [safety(0.0, 0.0, reason="boxed in", measure=0.1),
         permit()], 0, None, None, S, "boxed in", 0.1),
    Case("half a stop is not", [safety(0.0, 0.5, reason="ahead"), permit()], 0, None, None, None, SILENT),
    Case("nor the other half", [safety(0.5, 0.0, reason="behind"), permit()], 0, None, None, None, SILENT),
    # the lab's order: teleop over safety over permit over navigation
    Case("the stick beats navigation", [stick(), safety(), permit(), nav()], 2, -0.2, T, T, "stick"),
    Case("the stick beats safety", [stick(), safety(0.0), permit(), nav()], 2, -0.2, T, T, "stick"),
    Case("the stick needs neither permit nor lidar", [stick()], 2, -0.2, T, T, "stick"),
    Case("the stick does not beat e-stop", [estop(), stick()], 0, -0.2, T, E, "red button"),
    Case("a released e-stop is consent", [estop(INF), stick()], 2, -0.2, T, T, "stick"),
    # safety.binds_teleop
    Case("bound: safety limits the stick", [safety(0.5, reason="wall ahead"), stick(), permit(), nav()], 0.5, -0.2, T,
         S, "wall ahead", order=BOUND_ORDER),
    Case("bound: no lidar, no stick", [stick(), permit(), nav()], 0, -0.2, T, None, "no word from safety",
         order=BOUND_ORDER),
    Case("bound: the permit is still not the stick's business", [safety(), stick(), permit(0.0)], 2, -0.2, T, T,
         "stick", order=BOUND_ORDER),
    # a drive never goes out under a verdict older than its scan
    Case("verdict older than the scan", [safety(scan=0.975), permit(), nav(scan=1.0)], 0, 0.1, N, None, LATE),
    Case("verdict newer than the scan", [safety(scan=1.025), permit(), nav(scan=1.0)], 1, 0.1, N, N, OK),
    Case("an old verdict that stops still does not drive", [safety(0.0, scan=0.975), permit(), nav(scan=1.0)], 0, 0.1,
         N, None, LATE),
    Case("a human looks for himself", [safety(scan=0.2), stick(), permit()], 2, -0.2, T, T, "stick",
         order=BOUND_ORDER),
    # an emergency stop may take the wheels
    Case("an emergency stop steers", [swerve(), permit(), nav()], 0, -0.3, N, S, "swerving", 0.4, brake=2.0),
    Case("also straight on", [swerve(0.0), permit(), nav()], 0, 0.0, N, S, "swerving", 0.4, brake=2.0),
    Case("and a human, where safety binds him", [swerve(), stick(), permit()], 0, -0.3, T, S, "swerving", 0.4,
         brake=2.0, order=BOUND_ORDER),
    Case("who is above safety keeps the wheels", [stick(), swerve(), permit()], 2, -0.2, T, T, "stick"),
    Case("a slower drive steers itself", [swerve(forward=0.5), permit(), nav()], 0.5, 0.1, N, S, "swerving", 0.4,
         brake=2.0),
    Case("backwards nothing is taken", [swerve(), permit(), nav(-1.0)], -1, 0.1, N, N, OK),
    Case("an angle that is no number is not taken", [swerve(NAN), permit(), nav()], 0, 0.1, N, S, "swerving", 0.4,
         brake=2.0),
    Case("e-stop's wheels stay the driver's", [estop(), swerve(), permit(), nav()], 0, 0.1, N, E, "red button"),
    Case("the permit's stop does not steer back", [swerve(), permit(0.0, "no operator"), nav()], 0, -0.3, N, S,
         "swerving", 0.4, brake=2.0),
    Case("under an old verdict nobody swerves", [swerve(scan=0.975), permit(), nav(scan=1.0)], 0, 0.1, N, None, LATE),
    # a judge is asked about the very drive that would be sent
    Case("it would turn into the wall", [bend(), permit(), nav(2.0, 0.3)], 0.4, 0.3, N, S, "wall on the left", 0.3,
         brake=3.0),
    Case("it turns away from it", [bend(), permit(), nav(2.0, -0.3)], 2, -0.3, N, N, OK),
    Case("the stick is asked about its own steering", [bend(), stick(2.0, 0.3), permit(), nav(2.0, -0.3)], 0.4, 0.3, T,
         S, "wall on the left", 0.3, order=BOUND_ORDER, brake=3.0),
    Case("a tighter cap brings its own brake", [bend(), permit(0.0, "no"), nav(2.0, 0.3)], 0, 0.3, N, P, "no"),
    Case("when nobody drives it is asked about standing", [boxed(), permit()], 0, None, None, S, "boxed in"),
    # a driver that has no way out tells what it needs, where the car stands before something
    Case("stuck where the car stands", [stands(), permit(), stuck()], 0, 0.1, N, S, "needs help", 0.1),
    Case("standing, and not stuck", [stands(), permit(), nav()], 0, 0.1, N, S, "boxed in", 0.1),
    Case("stuck, and stopped for another reason", [safety(0.0, 0.0, reason="late"), permit(), stuck()], 0, 0.1, N, S,
         "late"),
    # not a number
    Case("speed is not a number", [safety(), permit(), nav(NAN)], 0, None, N, None,
         "navigation asked for something that is not a number"),
    Case("speed is infinite", [safety(), permit(), nav(INF)], 0, None, N, None,
         "navigation asked for something that is not a number"),
    Case("steering is not a number", [safety(), permit(), nav(1.0, NAN)], 0, None, N, None,
         "navigation asked for something that is not a number"),
]  # fmt: skip


def failing(arbitrate) -> list[str]:
    """Return the titles of the cases in which a function decides otherwise, or fails."""
    wrong = []
    for case in CASES:
        expected = Decision(case.speed, case.steering, case.driver, case.winner, case.reason, case.measure, case.brake)
        try:
            decided, _ = arbitrate(case.live, case.required, case.order)
            if not _same(decided, expected):
                wrong.append(case.title)
        except Exception:  # noqa: BLE001 - a mutant may fail in any way
            wrong.append(case.title)
    judge = Counting()
    try:
        _, memories = arbitrate([SpeedLimit(Source.SAFETY, judge, 1.0), permit(), nav()], REQUIRED, LAB_ORDER)
        if (judge, 1) not in memories or judge.memory:
            wrong.append("the memory after the command")
    except Exception:  # noqa: BLE001 - as above
        wrong.append("the memory after the command")
    return wrong


def _same(one: Decision, other: Decision) -> bool:
    both_nan = math.isnan(one.measure) and math.isnan(other.measure)
    return both_nan or one.measure == other.measure if _plain(one) == _plain(other) else False


def _plain(decision: Decision) -> Decision:
    return replace(decision, measure=0.0)
