"""An I2C bus of Linux, /dev/i2c-N: reads and writes of one chip. Blocks for the length of a transfer, 0.2 to 1 ms."""

import errno
import fcntl
import os
from collections.abc import Callable
from typing import Final, Protocol

from wallride.drivers.api import LinkLost

_SLAVE, _RETRIES, _TIMEOUT = 0x0703, 0x0701, 0x0702
TIMEOUT_10MS: Final = 3
"""Time [10 ms] after which the kernel gives up a bus that is held down: the event loop waits for it."""
REMEDIES: Final = {
    errno.ENOENT: "no such bus (enable I2C: raspi-config, or the overlay of this computer)",
    errno.EACCES: "permission denied (add the user to the group i2c, then log in again)",
    errno.EREMOTEIO: "no acknowledgement (power? wiring? motor.chip?)",
    errno.ENXIO: "no acknowledgement (power? wiring? motor.chip?)",
    errno.ETIMEDOUT: "the bus is held down (wiring? another device on it?)",
    errno.EIO: "a transfer failed (wiring? motor noise?)",
    errno.EBUSY: "a driver of the kernel holds this chip",
}


class I2cBus(Protocol):
    """One chip on a bus. OSError where it does not acknowledge."""

    def write(self, data: bytes) -> None:
        """Write a register's number and values from there on."""
        ...

    def read(self, register: int, count: int) -> bytes:
        """Read so many registers."""
        ...

    def close(self) -> None:
        """Close the bus."""
        ...


OpenBus = Callable[[int, int], I2cBus]
"""Takes the number of the bus and the chip's address; OSError where there is none."""


class LinuxI2cBus:
    """An `I2cBus` of the kernel."""

    def __init__(self, bus: int, chip: int) -> None:
        self._fd = os.open(f"/dev/i2c-{bus}", os.O_RDWR | os.O_CLOEXEC)
        try:
            fcntl.ioctl(self._fd, _SLAVE, chip)
            fcntl.ioctl(self._fd, _TIMEOUT, TIMEOUT_10MS)
            fcntl.ioctl(self._fd, _RETRIES, 0)
        except BaseException:
            os.close(self._fd)
            raise

    def write(self, data: bytes) -> None:
        """Write a register's number and values from there on."""
        if os.write(self._fd, data) != len(data):
            raise OSError(errno.EIO, "written in part")

    def read(self, register: int, count: int) -> bytes:
        """Read so many registers."""
        self.write(bytes((register,)))
        data = os.read(self._fd, count)
        if len(data) != count:
            raise OSError(errno.EIO, "read in part")
        return data

    def close(self) -> None:
        """Close the bus."""
        os.close(self._fd)


def lost(where: str, error: OSError) -> LinkLost:
    """Return an error of the bus in words."""
    return LinkLost(f"{where}: {REMEDIES.get(error.errno or 0, error)}")
