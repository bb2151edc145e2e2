"""Tells a motor without a tachometer the speed that the scans show, and the car how fast that motor drives."""

import math

from wallride.drivers.api import Motor, Scan
from wallride.drivers.pwm.driver import PwmMotor
from wallride.runtime.arbitration.command import Source, SpeedLimit, Verdict
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.control.perception.scan_speed import ScanSpeed
from wallride.runtime.control.vehicle import CarSettings


class SpeedByScans:
    """Learns after each answer, for a motor that needs it; of any other it does nothing.

    It puts the motor's maximum speed into the queue, at the start and whenever it changes; it never expires.
    words: what bounds the speed of such a car, for its status.
    """

    def __init__(self, motor: Motor, car: CarSettings, queue: CommandQueue) -> None:
        self._motor = motor if isinstance(motor, PwmMotor) else None
        self._queue, self._said = queue, (math.inf, "")
        self._estimator = ScanSpeed(car)

    def learn(self, scan: Scan) -> None:
        """Process one scan, in order."""
        if self._motor is not None:
            self._motor.learn(self._estimator.learn(scan, self._motor.state))
            self._bound(self._motor.max_speed_mps, self._motor.bounded_by)

    def _bound(self, most_mps: float, why: str) -> None:
        if (most_mps, why) != self._said:
            self._said = most_mps, why
            verdict = Verdict(most_mps, most_mps, f"no faster with this motor ({why})")
            self._queue.put(SpeedLimit(Source.MOTOR, verdict))

    @property
    def words(self) -> tuple[str, ...]:
        """What bounds the speed, in sentences."""
        return self._motor.words if self._motor is not None else ()
