"""What the VESC's replies say over time: the motor's state, faults that must not be forgotten, an empty battery."""

from dataclasses import replace

from drivers.api import Health, MotorState
from drivers.vesc.calibration import Calibration
from drivers.vesc.faults import fault_text
from drivers.vesc.replies import STATUS_KILLED, STATUS_TIMED_OUT, Values
from drivers.vesc.tachometer import Tachometer

LOW_VOLTAGE_S = 1.0
"""A dip shorter than this is the motor accelerating; the VESC itself faults where it becomes dangerous."""
_RECOVERED_BY_V = 0.3


class Condition:
    """Follows one VESC over all its connections.

    The VESC shows a fault for half a second only, then obeys again: latched here until an operator clears it.

    state: the newest report, None while disconnected.
    fault: latched words of the last fault, "" without one.
    """

    def __init__(self, calibration: Calibration, min_voltage_v: float, health: Health) -> None:
        self.state: MotorState | None = None
        self.fault = ""
        self._calibration = calibration
        self._min_voltage_v = min_voltage_v
        self._health = health
        self._tachometer = Tachometer()
        self._fault_code = 0
        self._low_since_s: float | None = None
        self._battery_trouble = ""

    @property
    def trouble(self) -> str:
        """What is wrong and what to do about it, "" when all is well; constant words while it lasts."""
        return self.fault or self._battery_trouble

    def update(self, values: Values, stamp_s: float, steering_rad: float) -> None:
        """Take a reply that arrived at this time, while this steering was commanded."""
        self._latch_fault(values.fault_code)
        self._watch_battery(values.voltage_v, stamp_s)
        restarts = self._tachometer.restarts
        self._tachometer.update(values.tachometer, values.tachometer_abs)
        if self._tachometer.restarts != restarts:
            self._health.count("reboot")
        status = values.status or 0
        self.state = MotorState(
            stamp_s=stamp_s,
            speed_mps=self._calibration.speed_mps(values.erpm),
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

    def disconnect(self) -> None:
        """Forget what is only true while connected; distance and fault stay."""
        self.state = None
        self._low_since_s = None

    def clear_fault(self) -> None:
        """Forget the latched fault; one that is still there comes back with the next reply."""
        self.fault = ""
        self._fault_code = 0
        if self.state is not None:
            self.state = replace(self.state, fault="")

    def _latch_fault(self, code: int) -> None:
        if code and code != self._fault_code:
            self._health.count("fault")
            self.fault = fault_text(code)
        self._fault_code = code

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
                f"{voltage_v:.1f} V is no battery or an empty one (plug it in, charge it, release its switch)"
            )
