"""Calls a law of the user within a time budget. Any mistake of it is a fault with file and line, never an exception.

A law is called, not awaited: also a cancellation that comes out of it is its own. A law with a fault is not called
again until `retry` makes a new one.
"""

import math
from collections.abc import Callable
from typing import Any, Literal, Protocol, TypeVar

from wallride.drivers.api import Clock
from wallride.runtime.control.own_laws.answer import WrongAnswerError
from wallride.runtime.control.own_laws.api import LawScan, LawSettings, LawState
from wallride.runtime.control.own_laws.law_class import LawClass
from wallride.runtime.control.perception.perception import Percept
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.host.stop_signals import STOP_SIGNALS_HELD
from wallride.runtime.host.user_module import is_of_the_process, place_of, shown_text, told

SLOW_IN_A_ROW = 3
"""Number of answers in a row over the budget that are a fault."""
FAR_OVER_BUDGET = 20.0
"""Multiple of the budget that is a fault at once."""
MAX_FAULT = 200
A = TypeVar("A")


class WantedDrive(Protocol):
    """The settings of every follower that an own law is told."""

    @property
    def side(self) -> Literal["left", "right"]:
        """Side of the followed wall."""

    @property
    def desired_distance_m(self) -> float:
        """Wanted distance from the rear axle to the wall."""

    @property
    def speed_mps(self) -> float:
        """Wanted speed."""


class OwnSection(Protocol):
    """Settings of an own law: its own, and the time allowed for an answer."""

    @property
    def own(self) -> LawSettings:
        """The law's own settings."""

    @property
    def budget_s(self) -> float:
        """Time allowed for an answer."""


class LawRunner:
    """One law of the user in operation.

    clock: measures the answers; None: not at all. fault: one sentence, "" while the law works. faults: their number;
    last_fault: the newest one, also after a `retry`.
    """

    def __init__(self, law: LawClass, settings: LawSettings, car: CarSettings, clock: Clock | None) -> None:
        self.law = law
        self.fault = self.last_fault = ""
        self.faults = 0
        self._settings, self._car, self._clock = settings, car, clock
        self._slow = 0
        self._made: Any = None
        self._make()

    def tune(self, settings: LawSettings) -> None:
        """Change the law's settings: its attribute `settings` is replaced; one with a fault is made anew with them."""
        if settings == self._settings:
            return
        self._settings = settings
        if self.fault:
            self.retry()
        else:
            self._run(lambda: setattr(self._made, "settings", settings))

    def retry(self) -> None:
        """Make a new law in place of one with a fault."""
        if self.fault:
            self.fault, self._slow = "", 0
            self._make()

    def call(self, scan: LawScan, state: LawState, budget_s: float, read: Callable[[Any], A]) -> A | None:
        """Return the law's answer to one scan, as `read` takes it; None, with `fault`, where there is none."""
        if self.fault:
            return None
        clock = self._clock
        began_s = clock() if clock is not None else 0.0
        answer = self._run(lambda: read(getattr(self._made, self.law.answer)(scan, state)))
        if answer is None or clock is None:
            return answer
        return answer if self._in_time(clock() - began_s, budget_s) else None

    def refuse(self, what: str) -> None:
        """Take something that the law did as a fault."""
        self._note(f"{self.law.name} {shown_text(what)} ({self.law.place})"[:MAX_FAULT])

    def _run(self, code: Callable[[], A]) -> A | None:
        """Run code of the user; None, with `fault`, where it fails or takes what is the process's."""
        answer = None
        try:
            answer = code()
        except WrongAnswerError as wrong:
            self.refuse(str(wrong))
        except BaseException as error:
            if is_of_the_process(error):
                raise
            self._note(f"{self.law.name} raised {told(error)[:MAX_FAULT]} ({place_of(error, self.law.file)})")
        if taken := STOP_SIGNALS_HELD.take_back():
            self.refuse(f"changed what {taken} does, which ends the process")
        return None if self.fault else answer

    def _in_time(self, took_s: float, budget_s: float) -> bool:
        self._slow = self._slow + 1 if took_s > budget_s else 0
        if self._slow < SLOW_IN_A_ROW and took_s <= FAR_OVER_BUDGET * budget_s:
            return True
        often = f" {self._slow} times in a row" if self._slow >= SLOW_IN_A_ROW else ""
        self.refuse(f"is too slow{often}: {1000 * took_s:.1f} ms where {1000 * budget_s:g} ms are allowed")
        return False

    def _make(self) -> None:
        self._made = self._run(lambda: self.law.made(self._settings, self._car))

    def _note(self, fault: str) -> None:
        self.fault = self.last_fault = fault
        self.faults += 1


def state_for_law(percept: Percept, wanted: WantedDrive) -> LawState:
    """Return the car at a scan as an own law gets it."""
    pose, motor = percept.pose, percept.motor
    steering_rad = motor.steering_rad if motor is not None else 0.0
    return LawState(
        pose.speed_mps, steering_rad, pose.x_m, pose.y_m, pose.yaw_rad,
        wanted.side, wanted.desired_distance_m, wanted.speed_mps,
    )  # fmt: skip


def scan_for_law(view: View) -> LawScan:
    """Return a scan as an own law gets it: without dirt, outliers and the car's own parts."""
    ranges_m = view.ranges_m.copy()
    ranges_m[~view.solid] = math.nan
    return LawScan(view.scan.stamp_s, view.bearing_rad, ranges_m, view.lidar_m.real, view.lidar_m.imag)
