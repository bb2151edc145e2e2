"""The battery's voice in the command queue: silent while the battery is good, else its limit on the speed."""

import logging
import math
from collections.abc import Callable, Mapping
from typing import Any

from wallride.drivers.api import Motor
from wallride.runtime.arbitration.command import Source, SpeedLimit, Verdict
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.control.battery import BatteryMonitor, BatterySettings, Charge

log = logging.getLogger("wallride.battery")


class BatteryLimit:
    """Puts the limit of a `BatteryMonitor` whenever it changes; it never expires.

    rearm: called with the reason when an empty battery has stopped the car, so that no button that is held then counts.
    """

    def __init__(
        self, settings: BatterySettings, motor: Motor, queue: CommandQueue, rearm: Callable[[str], None]
    ) -> None:
        self._monitor = BatteryMonitor(settings)
        self._motor = motor
        self._queue = queue
        self._rearm = rearm
        self._said: tuple[float, str] = (math.inf, "")
        self.check()

    def tick(self, _late_s: float, _missed: int) -> None:
        """Check once; a `periodic.Tick`."""
        self.check()

    def check(self) -> None:
        """Judge the newest report, and put what has changed."""
        monitor = self._monitor
        monitor.update(self._motor.state)
        limit = monitor.limit_mps, monitor.trouble
        if limit == self._said:
            return
        self._said = limit
        if not monitor.trouble:
            log.info("battery %.1f V, %d cells", monitor.voltage_v, monitor.cells)
            self._queue.withdraw(Source.BATTERY)
            return
        self._queue.put(SpeedLimit(Source.BATTERY, Verdict(limit[0], limit[0], monitor.trouble)))
        if monitor.charge in {Charge.LOW, Charge.EMPTY}:
            log.warning("%s", monitor.trouble)
        if monitor.charge is Charge.EMPTY:
            self._rearm(f"{monitor.trouble}; permit again")

    @property
    def stop(self) -> str:
        """Why the battery forbids any motion, "" while it does not."""
        return self._monitor.trouble if self._monitor.limit_mps <= 0.0 else ""

    def status(self) -> Mapping[str, Any]:
        """Return plain values."""
        return self._monitor.fields()
