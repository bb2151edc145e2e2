"""Calls a law of the user within a time budget. Any mistake of it is a fault with file and line, never an exception.

A law with a fault is not called again until `retry` makes a new one.
"""

import math
from typing import Any, Literal, Protocol

import numpy as np

from drivers.api import Clock, MotorState
from runtime.control.own_laws.api import LawScan, LawSettings, LawState
from runtime.control.own_laws.law_class import LawClass
from runtime.control.perception.odometry import Odometry
from runtime.control.perception.view import View
from runtime.control.vehicle import CarSettings
from runtime.host.user_module import place_of, told

SLOW_IN_A_ROW = 3
"""Number of answers in a row over the budget that are a fault."""
FAR_OVER_BUDGET = 20.0
"""Multiple of the budget that is a fault at once."""
MAX_REASON = 60
MAX_FAULT = 200


class WantedDrive(Protocol):
    """The settings of every follower that an own law is told."""

    @property
    def side(self) -> Literal["left", "right"]:
        """Side of the followed wall."""
        ...

    @property
    def desired_distance_m(self) -> float:
        """Wanted distance from the rear axle to the wall."""
        ...

    @property
    def speed_mps(self) -> float:
        """Wanted speed."""
        ...


class OwnSection(Protocol):
    """Settings of an own law: its own, and the time allowed for an answer."""

    @property
    def own(self) -> LawSettings:
        """The law's own settings."""
        ...

    @property
    def budget_s(self) -> float:
        """Time allowed for an answer."""
        ...


class LawRunner:
    """One law of the user in operation.

    clock: measures the answers; None: not at all. fault: one sentence, "" while the law works. faults: their number.
    """

    def __init__(self, law: LawClass, settings: LawSettings, car: CarSettings, clock: Clock | None) -> None:
        self.law = law
        self.fault = ""
        self.faults = 0
        self._settings, self._car, self._clock = settings, car, clock
        self._slow = 0
        self._made = self._make()

    def tune(self, settings: LawSettings) -> None:
        """Change the law's settings: its attribute `settings` is replaced."""
        if settings == self._settings:
            return
        self._settings = settings
        if not self.fault:
            try:
                self._made.settings = settings
            except Exception as error:  # noqa: BLE001 - a property of the user's class may raise anything
                self._fail(error)

    def retry(self) -> None:
        """Make a new law in place of one with a fault."""
        if self.fault:
            self.fault, self._slow = "", 0
            self._made = self._make()

    def call(self, scan: LawScan, state: LawState, budget_s: float) -> Any:  # noqa: ANN401 - whatever the law answers
        """Return the law's answer to one scan; None, with `fault`, where there is none."""
        if self.fault:
            return None
        clock = self._clock
        began_s = clock() if clock is not None else 0.0
        try:
            answer = getattr(self._made, self.law.answer)(scan, state)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - code of the user may raise anything
            self._fail(error)
            return None
        return answer if clock is None or self._in_time(clock() - began_s, budget_s) else None

    def refuse(self, what: str) -> None:
        """Take an answer as a fault: what the law did."""
        self.fault = f"{self.law.name} {what} ({self.law.place})"[:MAX_FAULT]
        self.faults += 1

    def _in_time(self, took_s: float, budget_s: float) -> bool:
        self._slow = self._slow + 1 if took_s > budget_s else 0
        if self._slow < SLOW_IN_A_ROW and took_s <= FAR_OVER_BUDGET * budget_s:
            return True
        often = f" {self._slow} times in a row" if self._slow >= SLOW_IN_A_ROW else ""
        self.refuse(f"is too slow{often}: {1000 * took_s:.1f} ms where {1000 * budget_s:g} ms are allowed")
        return False

    def _make(self) -> Any:  # noqa: ANN401 - an object of the user's class
        try:
            return self.law.made(self._settings, self._car)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - code of the user may raise anything
            self._fail(error)
            return None

    def _fail(self, error: BaseException) -> None:
        place = place_of(error, self.law.file)
        self.fault = f"{self.law.name} raised {told(error)[:MAX_FAULT]} ({place})"
        self.faults += 1


class StateReader:
    """Keeps the odometry for an own law, and makes what it is given."""

    def __init__(self, car: CarSettings) -> None:
        self._odometry = Odometry(car.wheelbase_m)

    def read(self, motor: MotorState | None, wanted: WantedDrive) -> LawState:
        """Return the state at one scan; call once for each."""
        pose = self._odometry.update(motor)
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


def is_number(value: object) -> bool:
    """Tell whether a value is a real, finite number: of Python or numpy, and no truth value."""
    try:
        return not isinstance(value, bool | str) and math.isfinite(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return False


def is_nan(value: object) -> bool:
    """Tell whether a value is a number that is not known."""
    return isinstance(value, float | np.floating) and math.isnan(value)


def is_infinite(value: object) -> bool:
    """Tell whether a value is infinite, of either sign."""
    return isinstance(value, float | np.floating) and math.isinf(value)


def is_text(value: object) -> bool:
    """Tell whether a value is a text."""
    return isinstance(value, str)


def kind_of_answer(value: object) -> str:
    """Return what kind of thing a law returned."""
    return "nothing" if value is None else f"a {type(value).__name__}"


def shown_value(value: object) -> str:
    """Return a value for a sentence: itself where it is short, else its type."""
    return repr(value)[:MAX_REASON] if isinstance(value, bool | int | float | str) else type(value).__name__
