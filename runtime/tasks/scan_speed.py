"""Tells a motor without a tachometer the speed that the scans show."""

from wallride.drivers.api import Motor, Scan
from wallride.drivers.pwm.driver import PwmMotor
from wallride.runtime.control.perception.scan_speed import ScanSpeed
from wallride.runtime.control.vehicle import CarSettings


class SpeedByScans:
    """Learns after each answer, for a motor that needs it; of any other it does nothing.

    words: what bounds the speed of such a car, for its status.
    """

    def __init__(self, motor: Motor, car: CarSettings) -> None:
        self._motor = motor if isinstance(motor, PwmMotor) else None
        self._estimator = ScanSpeed(car)

    def learn(self, scan: Scan) -> None:
        """Process one scan, in order."""
        if self._motor is not None:
            self._motor.learn(self._estimator.learn(scan, self._motor.state))

    @property
    def words(self) -> tuple[str, ...]:
        """What bounds the speed, in sentences."""
        return self._motor.words if self._motor is not None else ()
