"""The other end of a driver: what the conformance kit asks of a device, and the bench around an emulator."""

import math
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from wallride.drivers.conformance.port import EmulatorPort, now_s
from wallride.drivers.own import DriverSettings

Floats = npt.NDArray[np.float64]
NEAR_LEFT_M, AHEAD_M, RIGHT_M = 1.5, 2.0, 3.0
SILENT_FROM_RAD, SILENT_TO_RAD = -1.2, -0.9
"""Sector to the right in which nothing returns."""


def room_m(bearing_rad: Floats) -> Floats:
    """Return the ranges (n,) of the kit's room: near on the left, far on the right, NaN where nothing returns."""
    turned = np.remainder(bearing_rad + math.pi, math.tau) - math.pi
    ranges_m = np.where(np.abs(turned) < math.pi / 6, AHEAD_M, np.where(turned > 0, NEAR_LEFT_M, RIGHT_M))
    return np.where((turned > SILENT_FROM_RAD) & (turned < SILENT_TO_RAD), math.nan, ranges_m)


class LidarEmulator(Protocol):
    """A lidar's side of its protocol, without a port or a clock of its own.

    bearings_rad: (n,) directions of its beams, counter-clockwise from ahead. rate_hz: scans a second.
    """

    bearings_rad: Floats
    rate_hz: float

    def feed(self, data: bytes, now_s: float) -> bytes:
        """Take bytes of the driver; return the answer, b"" for none."""

    def scan(self, ranges_m: Floats, now_s: float) -> bytes:
        """Return the bytes of one scan, (n,) with NaN where nothing returns; b"" while it does not measure."""


class MotorEmulator(Protocol):
    """A motor controller's side of its protocol, without a port or a clock of its own.

    speed_mps: the speed last commanded, None for a brake, and before the first command. steering_rad: likewise.
    commands: number of motor commands received, brakes included. A controller that has no command timeout of its own
    says so by `has_no_timeout = True`; a computer that hangs then drives on.
    """

    speed_mps: float | None
    steering_rad: float
    commands: int

    def feed(self, data: bytes, now_s: float) -> bytes:
        """Take bytes of the driver; return the answer, b"" for none.

        Called also with b"", every few milliseconds, so that its command timeout acts while nothing comes.
        """

    def report(self, speed_mps: float, distance_m: float) -> bytes:
        """Note the wheels' motion; return bytes that it sends unasked, b"" for none."""


class DeviceBench(Protocol):
    """What the kit does to any device."""

    silence: bool

    def driver(self) -> Any:  # noqa: ANN401 - any class with the protocol
        """Return a new driver for it, not yet running."""

    async def start(self) -> None:
        """Plug it in."""

    async def close(self) -> None:
        """Unplug it for good."""

    async def unplug(self) -> None:
        """Pull its cable."""

    async def replug(self) -> None:
        """Put the cable back."""

    def send(self, data: bytes) -> None:
        """Have these bytes arrive at the driver."""

    def step(self, now_s: float) -> None:
        """Let it do what is due by now; called every few milliseconds."""

    @property
    def connected(self) -> bool:
        """Whether a driver has its port open."""


class LidarBench(DeviceBench, Protocol):
    """A lidar in the kit's room (`room_m`)."""

    def hold(self) -> None:
        """Keep what it sends until `release`."""

    def release(self) -> None:
        """Let what was held arrive in one burst."""


class MotorBench(DeviceBench, Protocol):
    """A motor controller whose wheels follow at once. has_no_timeout: it keeps its last command for ever."""

    has_no_timeout: bool

    @property
    def commanded(self) -> tuple[float | None, float, int]:
        """The speed last commanded [m/s], None for a brake; the steering [rad]; the number of motor commands."""

    def driven_mps(self, now_s: float) -> float | None:
        """Return the speed that it drives at now, None for a brake: its command timeout has acted where it is due."""


class EmulatorBench(EmulatorPort):
    """A driver's class and an emulator behind a port on loopback; a `LidarBench` or a `MotorBench`.

    The address is in the driver's setting `address`; settings: others.
    """

    def __init__(self, driver: type[Any], emulator: Any, **settings: object) -> None:  # noqa: ANN401 - either kind
        super().__init__(emulator.feed)
        self.emulator = emulator
        self._driver, self._settings = driver, settings
        self.has_no_timeout = getattr(emulator, "has_no_timeout", False)
        self._due_s = -math.inf
        self._distance_m, self._stepped_s = 0.0, now_s()

    async def close(self) -> None:
        """Unplug it for good."""
        await self.unplug()

    @property
    def commanded(self) -> tuple[float | None, float, int]:
        """See `MotorBench`."""
        return self.emulator.speed_mps, self.emulator.steering_rad, self.emulator.commands

    def driven_mps(self, now_s: float) -> float | None:
        """See `MotorBench`."""
        self.send(self.emulator.feed(b"", now_s))
        speed_mps: float | None = self.emulator.speed_mps
        return speed_mps

    def driver(self) -> Any:  # noqa: ANN401 - the user's
        """Return a new driver."""
        model: Any = getattr(self._driver, "Settings", DriverSettings)
        return self._driver(model(address=self.address, **self._settings), now_s)

    def step(self, now_s: float) -> None:
        """Let it send what is due."""
        if hasattr(self.emulator, "scan"):
            if now_s >= self._due_s:
                self._due_s = max(self._due_s + 1 / self.emulator.rate_hz, now_s)
                self.send(self.emulator.scan(room_m(self.emulator.bearings_rad), now_s))
            return
        speed_mps = self.emulator.speed_mps or 0.0
        self._distance_m += speed_mps * (now_s - self._stepped_s)
        self._stepped_s = now_s
        self.send(self.emulator.report(speed_mps, self._distance_m))
