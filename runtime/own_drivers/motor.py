"""A motor by a driver of the user: it is given what a motor may be given, and what it reports is checked.

Brakes in place of what must not be driven (a latched fault, a reversal at speed, a number that is none) are the car's,
so that no driver has to know these rules.
"""

import contextlib
import math
import time
from dataclasses import fields, replace
from operator import attrgetter, is_
from typing import Any, Final, Never

from wallride.drivers.api import Clock, Drive, Health, LinkState, MotorState
from wallride.drivers.link import Tap
from wallride.drivers.scan_check import FUTURE_S
from wallride.runtime.host.user_module import shown_text
from wallride.runtime.own_drivers.driver_class import load_driver
from wallride.runtime.own_drivers.running import MAX_WORDS, DriverRun
from wallride.runtime.own_drivers.settings import OwnMotorSettings

REVERSING_ABOVE_MPS: Final = 0.3
"""Maximum speed for a reversal; a faster car is braked before it drives the other way."""
MAX_SPEED_MPS: Final = 30.0
SURE_S, SMOOTH_S, GAINS_MPS = 1.0, 0.3, 0.15
"""Time of commands of one sign after which a driver's sign is judged, the time constant of the speed against them, and
what that gains where the sign is wrong. A reversal only slows the wheels down, in reports that lag a little later."""
OTHER_WAY: Final = "the wheels turn the other way than told: the sign of the driver's speed?"
UNTAKEN_S: Final = 1.0
"""Time for which a driver that says READY may answer commands with False."""
_NAMES: Final = tuple(field.name for field in fields(MotorState))
_VALUES: Final = attrgetter(*_NAMES)
_TYPES: Final = {"fault": str, "timed_out": bool, "killed": bool}
"""Fields that are no numbers."""
_FINITE: Final = ("stamp_s", "speed_mps", "distance_m", "steering_rad")


class OwnMotor:
    """A `Motor` (see wallride.drivers.api) around the user's. Counted in `health`: bad_command, fault, restart."""

    def __init__(self, settings: OwnMotorSettings, *, clock: Clock = time.monotonic) -> None:
        self._run = DriverRun(load_driver("motor", settings.driver), settings.own, clock, self.brake_now)
        self._settings, self._clock = settings, clock
        self._steering_rad = 0.0
        self._reported: MotorState | None = None
        self._given: tuple[object, ...] = ()  # what the driver's report held when it was taken
        self._begun_s = clock()
        self._latched, self._contradicts = "", False
        self._asked_way, self._asked_for_s, self._seen_s = 0.0, 0.0, clock()
        self._against_mps = self._least_mps = 0.0
        self._refused_s: float | None = None
        self._bad_commands = self._faults = 0
        self.braked_instead = False
        self.tap: Tap | None = None

    @property
    def left_behind(self) -> bool:
        """Whether the driver did not end when it was cancelled."""
        return self._run.left_behind

    @property
    def health(self) -> Health:
        """What the driver says of itself, unless it is wrong, silent, or a fault is latched."""
        state, said = self.state, self._run.health()
        said.counts |= {"bad_command": self._bad_commands, "fault": self._faults, "restart": self._run.faults}
        if said.link is LinkState.READY and state is None:
            said.link = LinkState.FAULTY
            age_s = self._clock() - (self._begun_s if self._reported is None else self._reported.stamp_s)
            said.message = f"{self._run.driver.name}: {self._run.silent(f'no report for {age_s:.1f} s', age_s)}"
        elif said.link is LinkState.READY and self._latched:
            said.link, said.trouble = LinkState.FAULTY, self._latched
            said.message = f"{said.identity or self._run.driver.name}: {self._latched}"
        return said

    @property
    def state(self) -> MotorState | None:
        """The newest report, None while there is none, an old one, or a wrong one."""
        run = self._run
        if not run.works():
            return None
        run.call(lambda: self._take(run.made.state))
        state = self._reported
        if not run.works() or state is None or self._clock() - state.stamp_s > self._settings.lost_after_s:
            return None
        return replace(state, fault=self._latched) if self._latched else state

    async def run(self) -> Never:
        """Maintain the connection; brake on every way out."""
        try:
            await self._run.keep(self._begin)
        finally:
            self.brake_now()
        raise AssertionError("unreachable: it has no end")

    def send(self, drive: Drive) -> bool:
        """Pass one command on; False where it was not written."""
        run, state = self._run, self.state
        if not run.works():
            return False
        asked = self._allowed(drive, state)
        self._look_at_sign(drive.speed_mps, state)
        written: Any = run.call(lambda: run.made.send(asked))
        if not run.works():  # a brake was written with the fault
            return False
        self._steering_rad = asked.steering_rad
        if not isinstance(written, bool):
            run.refuse(
                f"answered a command with a {type(written).__name__} where True or False is needed", run.driver.place
            )
        elif written or run.health().link is not LinkState.READY:
            self._refused_s = None
        elif self._refused_s is None:
            self._refused_s = self._clock()
        elif self._clock() - self._refused_s > UNTAKEN_S:
            run.refuse("answers commands with False although it says READY", run.driver.place)
        return bool(written is True)

    def brake_now(self) -> None:
        """Write one brake without the event loop: the last act of a process whose loop has ended. Never raises."""
        if self._run.made is not None:
            # The controller's own timeout remains.
            with contextlib.suppress(BaseException):  # a KeyboardInterrupt of its own too
                self._run.made.send(Drive(0.0, self._steering_rad))

    def latch_fault(self, words: str) -> None:
        """Latch a fault detected elsewhere; no effect where one is latched."""
        if not self._latched:
            self._latched, self._contradicts = words, True
            self._faults += 1

    def retry_fault(self) -> None:
        """Clear the latched fault if it is the device's own."""
        if not self._contradicts:
            self.clear_fault()

    def clear_fault(self) -> None:
        """Clear the latched fault, here and, where it has a `clear_fault`, in the driver."""
        self._latched, self._contradicts, self._reported = "", False, None
        self._given = ()
        clear = getattr(self._run.made, "clear_fault", None)
        if callable(clear) and not self._run.fault:
            self._run.call(clear)

    def _begin(self, made: Any) -> Any:  # noqa: ANN401 - the user's
        self._reported, self._given, self._begun_s, self._refused_s = None, (), self._clock(), None
        return made.run()

    def _allowed(self, drive: Drive, state: MotorState | None) -> Drive:
        """Return the command to pass on: itself, or a brake."""
        steering_rad = drive.steering_rad
        if not math.isfinite(drive.speed_mps + steering_rad) or math.isnan(drive.brake_mps2):
            self._bad_commands += 1
            self.braked_instead = True
            return Drive(0.0, self._steering_rad)
        is_stop = abs(drive.speed_mps) < self._settings.min_speed_mps
        reverses = (
            state is not None and abs(state.speed_mps) > REVERSING_ABOVE_MPS and state.speed_mps * drive.speed_mps < 0
        )
        self.braked_instead = not is_stop and (bool(self._latched) or reverses)
        if is_stop or self.braked_instead:
            return Drive(0.0, steering_rad, drive.brake_mps2)
        return drive

    def _look_at_sign(self, asked_mps: float, state: MotorState | None) -> None:
        """Latch a fault where the wheels gain speed the other way than they were told."""
        moves = abs(asked_mps) >= self._settings.min_speed_mps
        since_s, self._seen_s = min(self._clock() - self._seen_s, SMOOTH_S), self._clock()
        if not moves or state is None:
            return
        way = math.copysign(1.0, asked_mps)
        against_mps = max(0.0, -way * state.speed_mps)
        if way != self._asked_way:
            self._asked_way, self._asked_for_s = way, 0.0
            self._against_mps = self._least_mps = against_mps
        self._asked_for_s += since_s
        self._against_mps += since_s / SMOOTH_S * (against_mps - self._against_mps)
        self._least_mps = min(self._least_mps, self._against_mps)
        if self._asked_for_s > SURE_S and self._against_mps > self._least_mps + GAINS_MPS:
            self.latch_fault(OTHER_WAY)

    def _take(self, given: object) -> None:
        """Take a new report; a wrong one is a fault of the driver, and its own `fault` one of the device.

        It is copied, because a driver may write the next one into the same object.
        """
        if given is None:
            self._reported, self._given = None, ()
            return
        values = _VALUES(given) if isinstance(given, MotorState) else ()
        if values and len(values) == len(self._given) and all(map(is_, values, self._given)):
            return
        if fault := _malformed(given, values):
            self._run.refuse(fault, self._run.driver.place)
            return
        state = MotorState(*(_TYPES.get(name, float)(each) for name, each in zip(_NAMES, values, strict=True)))
        if fault := self._wrong(state):
            self._run.refuse(fault, self._run.driver.place)
            return
        self._reported, self._given = state, values
        if state.fault and not self._latched:
            self._latched = shown_text(state.fault)[:MAX_WORDS]
            self._faults += 1

    def _wrong(self, state: MotorState) -> str:
        for name in _FINITE:
            if not math.isfinite(getattr(state, name)):
                return f"reported {name} that is no finite number"
        if abs(state.speed_mps) > MAX_SPEED_MPS:
            return f"reported {state.speed_mps:.3g} m/s, which no such car drives"
        if (ahead_s := state.stamp_s - self._clock()) > FUTURE_S:
            return f"stamped a report {ahead_s:.3g} s in the future"
        if self._reported is not None and state.stamp_s < self._reported.stamp_s:
            return f"jumped back in time by {self._reported.stamp_s - state.stamp_s:.3g} s"
        return ""


def _malformed(given: object, values: tuple[object, ...]) -> str:
    """Return which value of a report has a wrong type; "" where none has. Numbers may be of a subclass, as numpy's."""
    if not isinstance(given, MotorState):
        return f"reported a {type(given).__name__} where a MotorState is needed"
    for name, each in zip(_NAMES, values, strict=True):
        needed = _TYPES.get(name)
        if type(each) is not needed if needed is not None else not isinstance(each, int | float):
            words = f"a {needed.__name__}" if needed is not None else "a number"
            return f"reported {name} as a {type(each).__name__} where {words} is needed"
    return ""
