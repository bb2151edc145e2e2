"""A car whose servo and ESC are driven by a PCA9685."""

import asyncio
import time
from typing import Final

from wallride.drivers.api import Clock, DriverError, LinkLost
from wallride.drivers.pca9685 import codec
from wallride.drivers.pca9685.bus import I2cBus, LinuxI2cBus, OpenBus, SocketI2cBus, lost
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.pwm.driver import NO_TIMEOUT, PwmMotor

CHECK_S: Final = 0.1
WAKES_S: Final = 0.001
"""Time that the oscillator needs."""


class Pca9685(PwmMotor):
    """A `Motor` (see wallride.drivers.api). open_bus: of a test; None: that of the settings."""

    def __init__(
        self, settings: Pca9685Settings, *, clock: Clock = time.monotonic, open_bus: OpenBus | None = None
    ) -> None:
        super().__init__(settings, clock=clock)
        self._chip, self._open_bus = settings, open_bus or _opener(settings.socket)

    async def open_port(self) -> "Pca9685Port":
        """Open the bus, and set the rate."""
        settings = self._chip
        where = f"PCA9685 at 0x{settings.chip:02x} of {settings.socket or f'/dev/i2c-{settings.bus}'}"
        try:
            bus = self._open_bus(settings.bus, settings.chip)
        except OSError as error:
            raise lost(where, error) from error
        port = Pca9685Port(settings, where, bus)
        try:
            await port.set_up()
        except BaseException:
            port.close()
            raise
        return port


class Pca9685Port:
    """The open board. It keeps its pulses as long as it has power, whatever happens to the computer."""

    unguarded = NO_TIMEOUT
    timed_out = False

    def __init__(self, settings: Pca9685Settings, where: str, bus: I2cBus) -> None:
        self._settings, self._bus, self.identity = settings, bus, where
        self._divisor = codec.prescale(settings.rate_hz)
        self._throttle = b""

    async def set_up(self) -> None:
        """Set the rate. The chip takes it asleep only, which ends all pulses for a moment."""
        try:
            self._bus.write(bytes((codec.MODE1, codec.SLEEP | codec.AUTO_INCREMENT)))
            self._bus.write(bytes((codec.PRESCALE, self._divisor)))
            self._bus.write(bytes((codec.MODE1, codec.AUTO_INCREMENT)))
        except OSError as error:
            raise lost(self.identity, error) from error
        await asyncio.sleep(WAKES_S)

    def write(self, steering_pulse_us: float, throttle_pulse_us: float) -> None:
        """Write both pulses; LinkLost where the chip does not acknowledge."""
        try:
            for data in codec.writes(self._settings, self._divisor, steering_pulse_us, throttle_pulse_us):
                self._bus.write(data)
        except OSError as error:
            raise lost(self.identity, error) from error
        self._throttle = codec.counts(throttle_pulse_us, self._divisor)

    async def check(self) -> None:
        """Read back mode, rate and throttle: a chip that lost its supply for a moment sleeps, and has none of them."""
        await asyncio.sleep(CHECK_S)
        try:
            mode, divisor = self._bus.read(codec.MODE1, 1)[0], self._bus.read(codec.PRESCALE, 1)[0]
            throttle = self._bus.read(codec.output(self._settings.throttle_channel), 4)
        except OSError as error:
            raise lost(self.identity, error) from error
        if mode & codec.SLEEP or divisor != self._divisor:
            raise LinkLost(f"{self.identity}: it was reset while it drove (brown-out of its supply? motor noise?)")
        if throttle != self._throttle:
            raise DriverError(f"{self.identity}: its throttle was changed (does another program use the bus?)")

    def close(self) -> None:
        """Close the bus; the chip keeps its last pulses."""
        self._bus.close()


def _opener(path: str) -> OpenBus:
    return (lambda _bus, chip: SocketI2cBus(path, chip)) if path else LinuxI2cBus
