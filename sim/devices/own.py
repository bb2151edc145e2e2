"""Emulators that come with the drivers of the user, behind ports, in place of the built-in emulated devices.

A driver's class names its emulator: `emulator = "module:Class"`; see `LidarEmulator` and `MotorEmulator` of
`wallride.drivers.conformance` for what that class has.
"""

import math
import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from wallride.drivers.conformance import LidarEmulator, MotorEmulator
from wallride.drivers.conformance.port import EmulatorPort
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.host.user_class import import_class
from wallride.runtime.host.user_module import UserCodeError
from wallride.runtime.own_drivers.driver_class import load_driver
from wallride.sim.devices.turning import Rays, See
from wallride.sim.devices.vesc import MotorDemand

_NO_RETURN_MM: Final = 65000
BRAKE_A: Final = 50.0
WIRING: Final = VescSettings()
"""Gains between the emulator's metres and the simulated wheels' revolutions."""


def emulator_of(section: str, driver: str) -> Any:  # noqa: ANN401 - the user's
    """Return a new emulator for a driver; UserCodeError where it names none that can be used."""
    made = load_driver(section, driver)
    name = getattr(made.made, "emulator", None)
    if not isinstance(name, str):
        raise UserCodeError(f'{made.place}: {driver} has no emulator to drive with; write emulator = "module:Class"')
    return import_class(name)()


class _OwnEmulator:
    """A device of the user at a port. feed: answers what comes in."""

    def __init__(self, feed: Callable[[bytes, float], bytes], clock: Callable[[], float]) -> None:
        self._clock = clock
        self._port = EmulatorPort(feed)

    async def start(self) -> str:
        """Listen; return the address."""
        await self._port.start()
        return self._port.address

    async def close(self) -> None:
        """Close the port."""
        await self._port.unplug()


class OwnLidarEmulator(_OwnEmulator):
    """A lidar of the user in the simulated world; takes the place of a `TurningEmulator`."""

    def __init__(self, emulator: LidarEmulator, *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(emulator.feed, clock)
        self._emulator = emulator
        self._due_s = -math.inf
        self.turns_past_back = 0

    @property
    def streaming(self) -> bool:
        """Return whether a driver is connected."""
        return self._port.connected

    def advance(self, now_s: float, see: See) -> float | None:
        """Measure where a scan is due, and send it; return the time after that, None where nothing was sent."""
        if now_s < self._due_s:
            return None
        self._due_s = max(self._due_s + 1 / self._emulator.rate_hz, now_s)
        bearings_rad = self._emulator.bearings_rad
        mm = see(Rays(bearings_rad, np.zeros(bearings_rad.size, np.complex128)))
        ranges_m = np.where((mm > 0) & (mm < _NO_RETURN_MM), mm / 1000.0, math.nan)
        data = self._emulator.scan(ranges_m, now_s)
        self._port.send(data)
        self.turns_past_back += 1
        return self._clock() if data and self.streaming else None


class OwnMotorEmulator(_OwnEmulator):
    """A motor controller of the user before the simulated wheels; takes the place of a `VescEmulator`."""

    def __init__(
        self, emulator: MotorEmulator, on_command: Callable[[float, MotorDemand], None], *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        super().__init__(self._feed, clock)
        self._emulator, self._on_command = emulator, on_command
        self.imu: tuple[float, ...] = ()

    @property
    def servo(self) -> float:
        """Return the servo position that stands for the commanded angle."""
        return WIRING.steering_to_servo_offset + WIRING.steering_to_servo_gain * self._emulator.steering_rad

    def demand(self, _now_s: float) -> MotorDemand:
        """Return the present demand on the motor."""
        speed_mps = self._emulator.speed_mps
        if speed_mps is None:
            return MotorDemand("brake", BRAKE_A)
        return MotorDemand("speed", speed_mps * WIRING.speed_to_erpm_gain + WIRING.speed_to_erpm_offset)

    def report(self, erpm: float, tachometer: int) -> None:
        """Pass the wheels' motion on, and let the time: its command timeout acts while nothing comes."""
        gain = WIRING.speed_to_erpm_gain
        self._port.send(self._feed(b"", self._clock()))
        self._port.send(self._emulator.report(erpm / gain, tachometer * 10 / gain))

    def _feed(self, data: bytes, now_s: float) -> bytes:
        before = self._emulator.commands
        answer = self._emulator.feed(data, now_s)
        if self._emulator.commands != before:
            self._on_command(now_s, self.demand(now_s))
        return answer
