"""Lidar and board of a car whose own process does not run, opened for one step of a calibration.

Pulses are ordered, and written anew while a scan is waited for. Where no order comes for a moment the pulse is neutral,
as it is at the end.
"""

import asyncio
import contextlib
from collections import deque
from typing import Any, Final

from wallride.clients.calibration.ways import CalibrationError
from wallride.doctor.lidar import remedy_of
from wallride.drivers.api import DriverError, Scan
from wallride.drivers.auto.settings import AutoLidarSettings
from wallride.drivers.pca9685 import codec
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.pwm.driver import PulsePort, PwmMotor
from wallride.runtime.ending import end
from wallride.runtime.lidars import lidar_for, motor_for
from wallride.runtime.settings.devices import AnyMotorSettings, TopicLidarSettings
from wallride.runtime.settings.tree import Settings

FIRST_SCAN_S: Final = 12.0
MAX_LATE_S: Final = 0.5
ORDER_LASTS_S: Final = 0.4
"""Time for which an order counts: a slow lidar has 0.2 s between two scans, each of which is followed by an order."""
WRITE_EVERY_S: Final = 0.05
"""Time between two writes of the same pulses: a board with a command timeout has one of 0.2 s."""
STOPS_S: Final = 1.0


class PulseDevices:
    """Both devices. pulses: of steering and throttle [us], the last ones written."""

    def __init__(self, settings: Settings, steering_us: float, neutral_us: float) -> None:
        if isinstance(settings.lidar, AutoLidarSettings | TopicLidarSettings):
            raise CalibrationError(
                f'lidar.driver = "{settings.lidar.driver}" names no lidar that can be opened here: wallride run writes'
                " down the one that it finds; by a scan from elsewhere no car is calibrated"
            )
        clock = asyncio.get_running_loop().time
        motor = motor_for(settings.motor, clock=clock)
        if not isinstance(motor, PwmMotor):
            raise CalibrationError(f"motor.driver = {settings.motor.driver}: this is about servo pulses")
        self._clock, self._motor, self._lidar = clock, motor, lidar_for(settings.lidar, clock=clock)
        self._settings = settings
        self.pulses = self._ordered = steering_us, neutral_us
        self._neutral_us, self._order_s = neutral_us, clock()
        self._port: PulsePort | None = None
        self._tasks: list[asyncio.Task[Any]] = []
        self._scans: deque[Scan] = deque(maxlen=1)
        self._came = asyncio.Event()

    async def open(self) -> None:
        """Open the board in neutral, then the lidar; CalibrationError with the remedy."""
        try:
            self._port = await self._motor.open_port()
            self._write(*self._ordered)
        except DriverError as error:
            raise CalibrationError(str(error)) from None
        self._tasks = [asyncio.create_task(one) for one in (self._lidar.run(self._on_scan), self._go_on(self._port))]
        try:
            await self._next(FIRST_SCAN_S)
        except TimeoutError:
            message = self._lidar.health.message
            raise CalibrationError(f"{message}: {remedy_of(message)}") from None

    async def order(self, steering_us: float, throttle_us: float, neutral_us: float) -> tuple[float, float]:
        """Write pulses [us], and go on with them for ORDER_LASTS_S; return those that the board makes of them."""
        self._ordered, self._neutral_us, self._order_s = (steering_us, throttle_us), neutral_us, self._clock()
        try:
            self._write(steering_us, throttle_us)
        except DriverError as error:
            raise CalibrationError(str(error)) from None
        motor = self._settings.motor
        return made_us(motor, steering_us), made_us(motor, throttle_us)

    async def next_scan(self) -> Scan:
        """Return the newest scan; CalibrationError where none comes, or the board is lost."""
        try:
            return await self._next(MAX_LATE_S)
        except TimeoutError:
            raise CalibrationError(f"no scan for {MAX_LATE_S} s: {self._lidar.health.message}; the car stops") from None

    async def close(self, stop_us: float, neutral_us: float) -> None:
        """Stop by a pulse where the car may move, then neutral; close both."""
        steering_us, throttle_us = self.pulses
        moves = stop_us != neutral_us or throttle_us != neutral_us
        with contextlib.suppress(CalibrationError):
            until_s = self._clock() + (STOPS_S if moves else 0.0)
            while self._clock() < until_s:
                await self.order(steering_us, stop_us, neutral_us)
                await asyncio.sleep(WRITE_EVERY_S)
        await end(*self._tasks)
        if self._port is not None:
            with contextlib.suppress(DriverError):
                self._write(steering_us, neutral_us)
            self._port.close()

    def _on_scan(self, scan: Scan) -> None:
        self._scans.append(scan)
        self._came.set()

    def _write(self, steering_us: float, throttle_us: float) -> None:
        if self._port is not None:
            self._port.write(steering_us, throttle_us)
            self.pulses = steering_us, throttle_us

    async def _go_on(self, port: PulsePort) -> None:
        """Write the ordered pulses anew, and look at the board."""
        looking = asyncio.create_task(_look_at(port))
        try:
            while not looking.done():
                steering_us, throttle_us = self._ordered
                is_old = self._clock() - self._order_s > ORDER_LASTS_S
                self._write(steering_us, self._neutral_us if is_old else throttle_us)
                await asyncio.wait({looking}, timeout=WRITE_EVERY_S)
            looking.result()
        finally:
            await end(looking)

    async def _next(self, within_s: float) -> Scan:
        async with asyncio.timeout(within_s):
            while not self._scans:
                for task in self._tasks:
                    if task.done() and (error := task.exception()) is not None:
                        raise CalibrationError(str(error)) from None
                self._came.clear()
                came = asyncio.create_task(self._came.wait())
                try:
                    await asyncio.wait({came, *self._tasks}, return_when=asyncio.FIRST_COMPLETED)
                finally:
                    came.cancel()
        return self._scans.pop()


def made_us(motor: AnyMotorSettings, pulse_us: float) -> float:
    """Return the pulse [us] that a board makes of a wanted one: a PCA9685 has steps of 4 us."""
    if not isinstance(motor, Pca9685Settings):
        return pulse_us
    divisor = codec.prescale(motor.rate_hz)
    return codec.pulse_us(codec.counts(pulse_us, divisor), divisor)


async def _look_at(port: PulsePort) -> None:
    while True:
        await port.check()
