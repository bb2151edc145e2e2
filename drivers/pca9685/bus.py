"""An I2C bus of Linux, /dev/i2c-N: reads and writes of one chip. Blocks for the length of a transfer, 0.2 to 1 ms.

A unix socket carries the same transfers to an emulated chip, one packet each.
"""

import errno
import fcntl
import os
import socket
from collections.abc import Callable
from typing import Final, Protocol

from wallride.drivers.api import LinkLost

_SLAVE, _RETRIES, _TIMEOUT = 0x0703, 0x0701, 0x0702
TIMEOUT_10MS: Final = 3
"""Time [10 ms] after which the kernel gives up a bus that is held down: the event loop waits for it."""
PACKET_BYTES: Final = 260
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

    def read(self, register: int, count: int) -> bytes:
        """Read so many registers."""

    def close(self) -> None:
        """Close the bus."""


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


class SocketI2cBus:
    """An `I2cBus` behind a unix socket, whose other end is in another process.

    A request is the chip's address, the number of bytes to read (0: a write), and what to write; its answer is an
    errno, 0 for an acknowledgement, and the bytes read.
    """

    def __init__(self, path: str, chip: int) -> None:
        self._chip = chip
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_CLOEXEC)
        try:
            self._socket.settimeout(TIMEOUT_10MS / 100)
            self._socket.connect(path)
        except BaseException:
            self._socket.close()
            raise

    def write(self, data: bytes) -> None:
        """Write a register's number and values from there on."""
        self._transfer(0, data)

    def read(self, register: int, count: int) -> bytes:
        """Read so many registers."""
        data = self._transfer(count, bytes((register,)))
        if len(data) != count:
            raise OSError(errno.EIO, "read in part")
        return data

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _transfer(self, count: int, data: bytes) -> bytes:
        self._socket.send(bytes((self._chip, count)) + data)
        answer = self._socket.recv(PACKET_BYTES)
        if not answer:
            raise OSError(errno.ENXIO, "the other end was closed")
        if answer[0]:
            raise OSError(answer[0], os.strerror(answer[0]))
        return answer[1:]


def lost(where: str, error: OSError) -> LinkLost:
    """Return an error of the bus in words."""
    return LinkLost(f"{where}: {REMEDIES.get(error.errno or 0, error)}")
