"""Judges every motor command of a random history by what reached the car, and by nothing of the car's code.

Sources: docs/decisions/0008-teleop-protocol.md and 0038-planners.md, docs/faults.md, docs/your-own-law.md. Every rule
is a necessary condition of motion: a command that breaks one is a violation in any case.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

LEASE_S: Final = 0.2
"""Life of a press or a planner's command after the beat that it echoes."""
SCAN_S: Final = 0.15
TICK_S: Final = 0.03
NOTICED_S: Final = 0.08
"""Time in which the car sees a fault of a law or of the motor: a health tick of 0.05 s, moved by a scan."""
SILENCE_S: Final = 0.1
MANUAL, AUTONOMY, ESTOP, RESET, TAKE_OVER, GOODBYE = 1, 2, 4, 8, 16, 32
MAX_KEPT: Final = 5
NEVER: Final = -1


@dataclass
class Client:
    """One session: what its newest command held that was fresh and new. released: number of its last release, while
    none of its commands came too late and no other press needed a new one."""

    sequence: int = 0
    fresh_until_s: float = -math.inf
    held_until_s: float = -math.inf
    flags: int = 0
    mark: float = math.nan
    released: int = NEVER
    over: bool = False


@dataclass
class Slot:
    """The newest command of one planner. mark: the steering that it asks for, NaN for a stand."""

    session: int = 0
    until_s: float = -math.inf
    mark: float = math.nan
    over: set[int] = field(default_factory=set)
    sequences: dict[int, int] = field(default_factory=dict)


@dataclass
class Moved:
    """A motor command that moves. driver: the car's word for who asked. mark: the steering that was asked for."""

    at_s: float
    speed_mps: float
    driver: str
    mark: float


class Judge:
    """Told of all that reaches the car, in its order; `violations` has the verdict.

    planners: their names, most urgent first.
    """

    def __init__(self, clock: Callable[[], float], planners: Sequence[str]) -> None:
        self.violations: Counter[str] = Counter()
        self.kept: list[str] = []
        self.moved: Counter[str] = Counter()
        self.incidents: Counter[str] = Counter()
        self.scan_s = -math.inf
        self.stopped_s = math.inf
        self.law_broken = False
        self._clock = clock
        self._beats: dict[int, float] = {}
        self._clients: dict[int, Client] = {}
        self._slots = {name: Slot() for name in planners}
        self._in_force = False
        self._operator: Client | None = None
        self._permitted_to = 0
        self._number = 0
        self._latched: dict[str, tuple[int, float]] = {}
        self._law: tuple[int, float] | None = None
        self._since: dict[bool, list[tuple[int, float]]] = {False: [], True: []}
        self._last_s = math.inf
        self._last_mps = 0.0

    # What reaches the car.

    def beat(self, number: int, operator: int, *, permitted: bool) -> None:
        """Note a heartbeat of the car. operator: its session. permitted: whether autonomy may move."""
        self._beats[number] = self._tell()
        self._operator = self._clients.get(operator)
        self._permitted_to = operator if permitted else 0

    def pressed(self, session: int, sequence: int, beat: int, flags: int, mark: float) -> None:
        """Note an operator's command that arrives."""
        now_s = self._tell()
        if flags & ESTOP or flags & 3 == 3:
            self._latched["e-stop"] = (self._number, now_s)
            self._incident("e-stop", now_s, by_hand=True)
        client = self._clients.setdefault(session, Client())
        until_s = self._beats.get(beat, -math.inf) + LEASE_S
        if now_s >= until_s or client.over or sequence <= client.sequence:
            return
        if now_s >= client.fresh_until_s:
            client.released = NEVER
        ends_it = flags == MANUAL or flags & GOODBYE
        if ends_it and session == self._permitted_to:  # the permit is over before a law's fault ends it
            self._since[False] = [one for one in self._since[False] if one != self._law or now_s >= one[1]]
        client.sequence, client.flags, client.mark, client.held_until_s = sequence, flags, mark, until_s
        client.fresh_until_s = max(client.fresh_until_s, until_s)
        self._obey(client, flags, now_s)

    def _obey(self, client: Client, flags: int, now_s: float) -> None:
        if flags == 0:
            client.released = self._number
        elif flags == RESET:
            for cause, (number, at_s) in list(self._latched.items()):
                unseen = client.released > NEVER and now_s < at_s  # cleared before the car has seen it
                if client.released > number or unseen:
                    del self._latched[cause]
            client.released = NEVER
        elif flags & TAKE_OVER:
            self._incident("take-over", now_s, by_hand=True)
            self._operator = client
        elif flags not in {MANUAL, AUTONOMY} or self._is_bystander(client, now_s):
            client.released = NEVER
            client.over = bool(flags & GOODBYE)

    def _is_bystander(self, client: Client, now_s: float) -> bool:
        """Tell whether another one operates: what is pressed meanwhile moves nothing when that one leaves."""
        other = self._operator
        return other is not None and other is not client and not other.over and now_s < other.fresh_until_s

    def planned(self, name: str, session: int, sequence: int, beat: int, flags: int, mark: float) -> None:
        """Note a planner's command that arrives, on its key."""
        now_s, slot = self._tell(), self._slots[name]
        until_s = self._beats.get(beat, -math.inf) + LEASE_S
        other = session != slot.session and now_s < slot.until_s
        if now_s >= until_s or other or session in slot.over or sequence <= slot.sequences.get(session, 0):
            return
        slot.session, slot.sequences[session] = session, sequence
        if flags & GOODBYE:
            slot.until_s = -math.inf
            slot.over.add(session)
            self._in_force = bool(self._first(now_s))  # left in order: no loss
        else:
            self._plan(slot, until_s, mark if flags else math.nan)

    def planned_by_ros(self, name: str, until_s: float, mark: float) -> None:
        """Note a command on /drive of a series that is long enough."""
        self._tell()
        self._plan(self._slots[name], until_s, mark)

    def _plan(self, slot: Slot, until_s: float, mark: float) -> None:
        slot.until_s, slot.mark = until_s, mark
        self._in_force = True

    def law_raised(self) -> None:
        """Note that the own law raised: it does not drive until it is made anew, nor does the permit of now."""
        now_s = self._tell()
        self.law_broken = True
        if self._lasts(now_s + NOTICED_S):
            self._incident("law", now_s + NOTICED_S)
            self._law = self._since[False][-1]

    def motor_faulted(self) -> None:
        """Note that the motor controller shows a fault: latched until a reset."""
        at_s = self._tell() + NOTICED_S
        self._latched["motor fault"] = (self._number, at_s)
        self._incident("motor fault", at_s, by_hand=True)

    def gone(self) -> None:
        """Note that the motor takes nothing any longer."""
        self._last_s, self._last_mps = math.inf, 0.0

    def returned(self, device: str) -> None:
        """Note that a device is back that the car must have missed."""
        self._incident(f"{device} lost", self._tell(), by_hand=device == "motor")

    def stalled(self, seconds: float) -> None:
        """Note that the car's process did nothing for a time: what it had not noticed before, it notices afterwards."""
        self._last_s = math.inf
        now_s = self._tell()
        for hand, since in self._since.items():
            self._since[hand] = [
                (number, max(at_s, now_s + NOTICED_S) if at_s > now_s - seconds else at_s) for number, at_s in since
            ]
        for cause, (number, at_s) in self._latched.items():
            if at_s > now_s - seconds:
                self._latched[cause] = number, max(at_s, now_s + NOTICED_S)

    def asked_to_stop(self) -> None:
        """Note that the process was asked to end."""
        self.stopped_s = self._tell()

    # What the car does.

    def sent(self, moved: Moved) -> None:
        """Judge a motor command."""
        now_s = self._tell()
        if self._last_mps and now_s - self._last_s > SILENCE_S:
            self._break("a moving car was left without a command", f"{now_s - self._last_s:.3f} s")
        self._last_s, self._last_mps = now_s, moved.speed_mps
        if not moved.speed_mps:
            return
        self.moved[moved.driver] += 1
        if now_s > self.stopped_s:
            self._break("motion after the stop of the process", moved.driver)
        for cause, (_, at_s) in self._latched.items():
            if now_s >= at_s:
                self._break(f"motion while latched: {cause}", moved.driver)
        if moved.driver == "teleop":
            if not any(one.mark == moved.mark for one in self._holding(MANUAL, now_s)):
                self._break("by hand without a fresh press after the last incident", "")
        else:
            self._judge_autonomy(moved, now_s)

    def ended(self, last_mps: float) -> None:
        """Judge the end: the last word that the motor took is a brake."""
        if last_mps:
            self._break("the last word is no brake", f"{last_mps:.2f} m/s")

    def _judge_autonomy(self, moved: Moved, now_s: float) -> None:
        first = self._first(now_s)
        if not self._holding(AUTONOMY, now_s):
            self._break("autonomy without a fresh permit after the last incident", moved.driver)
        if now_s - self.scan_s > SCAN_S + TICK_S:
            self._break("autonomy without a fresh scan", f"{now_s - self.scan_s:.3f} s old")
        if moved.driver == "navigation" and first is not None:
            self._break("the follower drives although a planner has the car", "")
        if moved.driver == "navigation" and self.law_broken:
            self._break("a law with a fault drives", "")
        if moved.driver == "planner" and (first is None or first.mark != moved.mark):
            self._break("not the most urgent planner drives", "none" if first is None else f"{first.mark}")

    # What follows from it.

    def _tell(self) -> float:
        """Begin a new fact; return its time. A planner that fell silent before it is noted first."""
        now_s = self._clock()
        if self._in_force and self._first(now_s) is None:
            self._in_force = False
            lost_s = max(slot.until_s for slot in self._slots.values())
            if self._lasts(lost_s + TICK_S):
                self._incident("planner lost", lost_s)
        self._number += 1
        return now_s

    def _first(self, now_s: float) -> Slot | None:
        return next((slot for slot in self._slots.values() if now_s < slot.until_s), None)

    def _incident(self, name: str, at_s: float, *, by_hand: bool = False) -> None:
        """Note that from at_s on only what is released and pressed from now on moves the car."""
        self._number += 1
        self.incidents[name] += 1
        for hand in {False, by_hand}:
            self._since[hand].append((self._number, at_s))

    def _lasts(self, until_s: float) -> bool:
        """Tell whether the permit that the car shows lasts so long, so that the car must have ended it."""
        client = self._clients.get(self._permitted_to)
        return client is not None and client.flags == AUTONOMY and client.held_until_s > until_s

    def _holding(self, flags: int, now_s: float) -> list[Client]:
        """Return the clients whose press of this kind counts."""
        since = max((number for number, at_s in self._since[flags == MANUAL] if at_s <= now_s), default=0)
        return [
            one for one in self._clients.values()
            if one.flags == flags and one.released > since and now_s < one.held_until_s and not one.over
        ]  # fmt: skip

    def _break(self, rule: str, what: str) -> None:
        self.violations[rule] += 1
        if len(self.kept) < MAX_KEPT:
            self.kept.append(f"{self._clock():8.3f} s  {rule}: {what}")
