"""Lidar and board of a car whose process does not run, opened for one step of a calibration.

The event loop runs while a scan is waited for. Whatever ends a step, the last pulse is neutral: an exception, Ctrl-C, a
lost lidar, a terminal that goes away.
"""

import asyncio
import contextlib
import signal
from collections import deque
from types import FrameType
from typing import Any

from wallride.clients.calibration.ways import CalibrationError
from wallride.doctor.lidar import remedy_of
from wallride.drivers.api import DriverError, Scan
from wallride.drivers.auto.settings import AutoLidarSettings
from wallride.drivers.pca9685 import codec
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.pwm.driver import PulsePort, PwmMotor
from wallride.runtime.ending import end
from wallride.runtime.lidars import lidar_for, motor_for
from wallride.runtime.settings.devices import AnyMotorSettings
from wallride.runtime.settings.scan_topic import TopicLidarSettings
from wallride.runtime.settings.tree import Settings

FIRST_SCAN_S, MAX_LATE_S = 12.0, 0.5
WRITE_EVERY_S = 0.05
"""Time between two writes of the same pulses: a board with a command timeout has one of 0.2 s."""
STOPS_S = 1.0
ENDING = (signal.SIGTERM, signal.SIGHUP)


class PulseBench:
    """Implements OpenBench with the devices of these settings."""

    def __init__(self, settings: Settings) -> None:
        if isinstance(settings.lidar, AutoLidarSettings | TopicLidarSettings):
            raise CalibrationError(
                f'lidar.driver = "{settings.lidar.driver}" names no lidar that can be opened here: wallride run writes'
                " the one that it finds; a scan from elsewhere cannot be calibrated by"
            )
        self._settings = settings
        self._loop: asyncio.AbstractEventLoop | None = None
        self._port: PulsePort | None = None
        self._tasks: list[asyncio.Task[Any]] = []
        self._scans: deque[Scan] = deque(maxlen=1)
        self._came = asyncio.Event()
        self._pulses = (0.0, 0.0)
        self._handlers: dict[signal.Signals, Any] = {}

    def open(self, steering_us: float, neutral_us: float) -> None:
        """Open board and lidar, in neutral; CalibrationError with the remedy."""
        self._loop, self._pulses = asyncio.new_event_loop(), (steering_us, neutral_us)
        self._handlers = {number: signal.signal(number, _leave) for number in ENDING}
        self._loop.run_until_complete(self._open())

    def write(self, steering_us: float, throttle_us: float) -> tuple[float, float]:
        """Write pulses [us]; return those that the board makes of them."""
        self._pulses = steering_us, throttle_us
        if self._port is not None:
            try:
                self._port.write(*self._pulses)
            except DriverError as error:
                raise CalibrationError(str(error)) from None
        motor = self._settings.motor
        return made_us(motor, steering_us), made_us(motor, throttle_us)

    def next_scan(self) -> Scan:
        """Return the newest scan; CalibrationError where none comes, or the board is lost."""
        if self._loop is None:
            raise CalibrationError("lidar and board are not open")
        return self._loop.run_until_complete(self._next(MAX_LATE_S, f"no scan for {MAX_LATE_S} s: the car stops"))

    def close(self, stop_us: float, neutral_us: float) -> None:
        """Stop, then neutral; close both."""
        loop, self._loop = self._loop, None
        if loop is None:
            return
        steering_us, last_us = self._pulses
        try:
            if last_us != neutral_us:
                loop.run_until_complete(self._stop(steering_us, stop_us))
        finally:
            self._let_go(steering_us, neutral_us)
            tasks, self._tasks = self._tasks, []
            loop.run_until_complete(end(*tasks))
            loop.close()
            for number, handler in self._handlers.items():
                signal.signal(number, handler)

    async def _open(self) -> None:
        motor = motor_for(self._settings.motor, clock=asyncio.get_running_loop().time)
        if not isinstance(motor, PwmMotor):
            raise CalibrationError(f"motor.driver = {self._settings.motor.driver}: this is about servo pulses")
        try:
            self._port = await motor.open_port()
        except DriverError as error:
            raise CalibrationError(str(error)) from None
        self.write(*self._pulses)
        lidar = lidar_for(self._settings.lidar, clock=asyncio.get_running_loop().time)
        self._came, self._scans = asyncio.Event(), deque(maxlen=1)
        self._tasks = [asyncio.create_task(lidar.run(self._on_scan)), asyncio.create_task(_watch(self._port))]
        try:
            await self._next(FIRST_SCAN_S, "")
        except CalibrationError as error:
            words = str(error) or f"{lidar.health.message}: {remedy_of(lidar.health.message)}"
            raise CalibrationError(words) from None

    def _on_scan(self, scan: Scan) -> None:
        self._scans.append(scan)
        self._came.set()

    async def _next(self, within_s: float, late: str) -> Scan:
        """Wait for a scan, and write the pulses anew meanwhile."""
        loop = asyncio.get_running_loop()
        give_up_s = loop.time() + within_s
        while not self._scans:
            if loop.time() > give_up_s:
                raise CalibrationError(late)
            for task in self._tasks:
                if task.done() and (error := task.exception()) is not None:
                    raise CalibrationError(str(error)) from None
            self.write(*self._pulses)
            self._came.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(WRITE_EVERY_S):
                    await self._came.wait()
        return self._scans.pop()

    async def _stop(self, steering_us: float, stop_us: float) -> None:
        until_s = asyncio.get_running_loop().time() + STOPS_S
        with contextlib.suppress(CalibrationError):
            while asyncio.get_running_loop().time() < until_s:
                self.write(steering_us, stop_us)
                await asyncio.sleep(WRITE_EVERY_S)

    def _let_go(self, steering_us: float, neutral_us: float) -> None:
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(DriverError):
                port.write(steering_us, neutral_us)
            port.close()


def made_us(motor: AnyMotorSettings, pulse_us: float) -> float:
    """Return the pulse [us] that a board makes of a wanted one: a PCA9685 has steps of 4 us."""
    if not isinstance(motor, Pca9685Settings):
        return pulse_us
    divisor = codec.prescale(motor.rate_hz)
    return codec.pulse_us(codec.counts(pulse_us, divisor), divisor)


async def _watch(port: PulsePort) -> None:
    while True:
        await port.check()


def _leave(number: int, _frame: FrameType | None) -> None:
    """End as Ctrl-C does: a terminal that went away ends the process, and a board may go on with its last pulse."""
    raise SystemExit(128 + number)
