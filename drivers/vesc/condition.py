"""The VESC's condition over time, from its replies: the motor's state, latched faults, an empty battery."""

import math
from dataclasses import replace

from wallride.drivers.api import Health, MotorState
from wallride.drivers.vesc.calibration import Calibration
from wallride.drivers.vesc.cross_check import CrossCheck
from wallride.drivers.vesc.faults import fault_text
from wallride.drivers.vesc.replies import STATUS_KILLED, STATUS_TIMED_OUT, Values

MAX_STEPS_PER_POLL = 1000
"""Maximum steps between two polls while driving: 2.2 m at the stock gearing."""
RESTARTS_APART_S = 1.0
"""Minimum time between two restarts: no VESC boots twice within this."""
LOW_VOLTAGE_S = 1.0
"""Minimum duration of a low voltage: a shorter dip is the motor accelerating; the VESC itself faults where it becomes
dangerous."""
_RECOVERED_BY_V = 0.3
_USB_ONLY_V = 6.0
"""Minimum voltage of a battery pack; below it the USB cable feeds the controller alone."""
_BLIND_AFTER_S = 0.05
"""Maximum age of the last accepted reply while one refused reply is skipped."""


class Tachometer:
    """Sums signed steps; 6 steps are one electrical turn of the motor.

    The counter is an int32 that wraps, and restarts at 0 when the VESC does. A reboot shows in the absolute counter
    beside it, which otherwise never runs backwards and begins at 0, or in a jump that is too large to have been driven;
    then the sum continues from its last value and the distance in between is unknown. An absolute counter that runs
    backwards without a reboot is ignored. Source: `motor/mcpwm_foc.c`.

    steps: signed sum since the first update.
    restarts: number of times that the sum was re-anchored. contradictions: number of times that the absolute counter
        ran backwards.
    """

    def __init__(self) -> None:
        self.steps = 0
        self.restarts = 0
        self.contradictions = 0
        self._restarted_s = -math.inf
        self._last: tuple[int, int] | None = None

    def update(self, tachometer: int, tachometer_abs: int, stamp_s: float) -> None:
        """Take one reading of both counters, and its time."""
        if self._last is not None:
            moved = _wrapped(tachometer - self._last[0])
            went_back = _wrapped(tachometer_abs - self._last[1]) < 0
            booted = went_back and 0 <= tachometer_abs <= MAX_STEPS_PER_POLL
            if abs(moved) > MAX_STEPS_PER_POLL or (booted and stamp_s - self._restarted_s > RESTARTS_APART_S):
                self.restarts += 1
                self._restarted_s = stamp_s
            else:
                self.steps += moved
                self.contradictions += went_back
        self._last = (tachometer, tachometer_abs)


def _wrapped(difference: int) -> int:
    """Bring the difference of two int32 counters back into the int32 range."""
    return (difference + 2**31) % 2**32 - 2**31


class VescMonitor:
    """Monitors one VESC over all its connections.

    The VESC shows a fault for half a second only, then obeys again: latched here until an operator clears it.

    state: the newest report, None while disconnected.
    fault: latched text of the last fault, "" without one: the VESC's own, or that its reports contradict each other.
    contradicts: whether it is a contradiction, which only a person mends.
    refused_mps: the last implausible speed; None while replies are accepted. blind: replies were refused for so long
        that the speed is unknown: brake.
    """

    def __init__(self, calibration: Calibration, min_voltage_v: float, health: Health) -> None:
        self.state: MotorState | None = None
        self.fault = ""
        self.contradicts = False
        self._calibration = calibration
        self._min_voltage_v = min_voltage_v
        self._health = health
        self._tachometer = Tachometer()
        self._check = CrossCheck(calibration.metres_per_step)
        self.refused_mps: float | None = None
        self.blind = False
        self._fault_code = 0
        self._low_since_s: float | None = None
        self._battery_trouble = ""

    @property
    def trouble(self) -> str:
        """The present problem and its remedy, "" without one; constant text while it lasts."""
        return self.fault or self._battery_trouble

    def asked(self, speed_mps: float) -> None:
        """Note the speed that was sent, 0 for a brake.

        A speed that is too small to hold and not 0 is no other wish: after a brake of the driver's own the speed rises
        from there again, while the wheels still turn the other way.
        """
        if speed_mps == 0.0 or not self._calibration.is_stop(speed_mps):
            self._check.asked(speed_mps)

    def update(self, values: Values, stamp_s: float, steering_rad: float) -> bool:
        """Take a reply that arrived at this time, while this steering was commanded; False when it is implausible.

        A fault code counts in an implausible one, too: it is shown for half a second only.
        """
        self._latch_fault(values.fault_code)
        speed_mps = self._calibration.speed_mps(values.erpm)
        if not self._check.is_possible(speed_mps, stamp_s):
            believed_s = self.state.stamp_s if self.state is not None else -math.inf
            self.blind = self.refused_mps is not None or stamp_s - believed_s > _BLIND_AFTER_S
            self.refused_mps = speed_mps
            return False
        self.refused_mps, self.blind = None, False
        self._watch_battery(values.voltage_v, stamp_s)
        if wrong := self._check.judge(speed_mps, self._count_steps(values, stamp_s), stamp_s):
            self.latch(wrong)
        status = values.status or 0
        self.state = MotorState(
            stamp_s=stamp_s,
            speed_mps=speed_mps,
            distance_m=self._tachometer.steps * self._calibration.metres_per_step,
            steering_rad=steering_rad,
            voltage_v=values.voltage_v,
            motor_current_a=values.motor_current_a,
            input_current_a=values.input_current_a,
            temperature_c=values.mosfet_temperature_c,
            fault=self.fault,
            timed_out=bool(status & STATUS_TIMED_OUT),
            killed=bool(status & STATUS_KILLED),
        )
        return True

    def disconnect(self) -> None:
        """Forget all state that is valid only while connected; distance and fault stay."""
        self.state = self.refused_mps = None
        self.blind = False
        self._low_since_s = None

    def latch(self, words: str) -> None:
        """Latch a contradiction, which is no fault of the VESC's own; no effect where a fault is latched."""
        if not self.fault:
            self.contradicts = True
            self._health.count("fault")
            self.fault = words
            if self.state is not None:
                self.state = replace(self.state, fault=words)

    def clear_fault(self) -> None:
        """Clear the latched fault; one that is still present comes back with the next reply."""
        self.fault = ""
        self.contradicts = False
        self._fault_code = 0
        self._check.forget()
        if self.state is not None:
            self.state = replace(self.state, fault="")

    def _latch_fault(self, code: int) -> None:
        if code and code != self._fault_code:
            self._health.count("fault")
            self.fault = fault_text(code)
            if self.state is not None:
                self.state = replace(self.state, fault=self.fault)
        self._fault_code = code

    def _count_steps(self, values: Values, stamp_s: float) -> float:
        """Return the distance counted since the last reply; report a reboot and an implausible counter."""
        tachometer = self._tachometer
        steps, restarts, contradictions = tachometer.steps, tachometer.restarts, tachometer.contradictions
        tachometer.update(values.tachometer, values.tachometer_abs, stamp_s)
        if tachometer.restarts != restarts:
            self._health.count("reboot")
            self._check.forget()
        if tachometer.contradictions != contradictions:
            self._health.count("bad_counter")
        return (tachometer.steps - steps) * self._calibration.metres_per_step

    def _watch_battery(self, voltage_v: float, stamp_s: float) -> None:
        if voltage_v >= self._min_voltage_v:
            self._low_since_s = None
            if voltage_v >= self._min_voltage_v + _RECOVERED_BY_V:
                self._battery_trouble = ""
            return
        if self._low_since_s is None:
            self._low_since_s = stamp_s
        if not self._battery_trouble and stamp_s - self._low_since_s >= LOW_VOLTAGE_S:
            self._battery_trouble = (
                f"no battery: {voltage_v:.1f} V (plug it in, release its switch)"
                if voltage_v < _USB_ONLY_V
                else f"battery empty: {voltage_v:.1f} V, less than {self._min_voltage_v:g} V (charge or change it)"
            )
