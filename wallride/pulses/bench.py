"""Lidar and board of a car for the steps of a calibration: one pair for each step, in an event loop of its own.

Whatever ends a step, the car is stopped and the last pulse is neutral: an error, Ctrl-C, a lost lidar, a terminal that
goes away.
"""

import signal
from types import FrameType
from typing import Any, Final

from wallride.clients.calibration.ways import CalibrationError
from wallride.clients.remote.loop_thread import LoopThread
from wallride.drivers.api import Scan
from wallride.pulses.devices import PulseDevices
from wallride.runtime.settings.tree import Settings

ENDING: Final = (signal.SIGTERM, signal.SIGHUP)


class PulseBench:
    """Implements OpenBench with the devices of these settings."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._thread: LoopThread | None = None
        self._devices: PulseDevices | None = None
        self._handlers: dict[signal.Signals, Any] = {}

    def open(self, steering_us: float, neutral_us: float) -> None:
        """Open board and lidar, in neutral; CalibrationError with the remedy."""
        self._handlers = {number: signal.signal(number, _leave) for number in ENDING}
        self._thread = LoopThread()

        async def open_devices() -> None:
            self._devices = PulseDevices(self._settings, steering_us, neutral_us)
            await self._devices.open()

        self._thread.call(open_devices())

    def write(self, steering_us: float, throttle_us: float, neutral_us: float) -> tuple[float, float]:
        """Write pulses [us]; return those that the board makes of them."""
        thread, devices = self._opened()
        return thread.call(devices.order(steering_us, throttle_us, neutral_us))

    def next_scan(self) -> Scan:
        """Return the newest scan; CalibrationError where none comes, or the board is lost."""
        thread, devices = self._opened()
        return thread.call(devices.next_scan())

    def close(self, stop_us: float, neutral_us: float) -> None:
        """Stop, then neutral; close both."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        try:
            if self._devices is not None:
                thread.call(self._devices.close(stop_us, neutral_us))
        finally:
            thread.close()
            for number, handler in self._handlers.items():
                signal.signal(number, handler)

    def _opened(self) -> tuple[LoopThread, PulseDevices]:
        if self._thread is None or self._devices is None:
            raise CalibrationError("lidar and board are not open")
        return self._thread, self._devices


def _leave(number: int, _frame: FrameType | None) -> None:
    """End as Ctrl-C does: a terminal that went away ends the process, and a board may go on with its last pulse."""
    raise SystemExit(128 + number)
