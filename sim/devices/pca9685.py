"""An emulated PCA9685 with an ESC and a servo at its outputs, behind an `I2cBus` as the kernel's, or a unix socket."""

import contextlib
import errno
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from wallride.drivers.api import Clock
from wallride.drivers.pca9685.bus import PACKET_BYTES
from wallride.sim.devices.esc import EmulatedEsc

_MODE1, _PRESCALE, _FIRST = 0x00, 0xFE, 0x06
_ASLEEP, _SLEEP, _INCREMENT = 0x11, 0x10, 0x20
_POWER_ON_PRESCALE: Final = 0x1E


class Pca9685Chip:
    """The chip. It goes on with its pulses whatever the bus does.

    Faults: unplugged (nothing acknowledges), nack_every (every n-th transfer is not acknowledged), `brown_out`.
    """

    def __init__(
        self, esc: EmulatedEsc, *, throttle: int = 0, steering: int = 1, chip: int = 0x40,
        clock: Clock = time.monotonic,
    ) -> None:  # fmt: skip
        self.esc, self._clock = esc, clock
        self._throttle, self._steering, self._chip = throttle, steering, chip
        self.unplugged = False
        self.nack_every: int | None = None
        self.transfers = 0
        self.open_buses = 0
        self._power_on()

    def open(self, _bus: int, chip: int) -> "Pca9685Bus":
        """Open the bus; takes the place of `LinuxI2cBus`."""
        self.open_buses += 1
        return Pca9685Bus(self, self._close, answers=chip == self._chip)

    def brown_out(self) -> None:
        """Lose the supply for a moment: the chip sleeps, and no pulse comes."""
        self._power_on()
        self.esc.no_signal()

    def write(self, data: bytes) -> None:
        """Take a register's number and values."""
        self._acknowledge()
        at, before = data[0], bytes(self.registers)
        for number, value in enumerate(data[1:]):
            register = at + number * bool(self.registers[_MODE1] & _INCREMENT)
            if register != _PRESCALE or self.registers[_MODE1] & _SLEEP:
                self.registers[register] = value
        if at >= _FIRST and at != _PRESCALE and not self.registers[_MODE1] & _SLEEP:
            self._pulse(before)

    def read(self, register: int, count: int) -> bytes:
        """Return registers."""
        self._acknowledge()
        return bytes(self.registers[register : register + count])

    def _pulse(self, before: bytes) -> None:
        at = _FIRST + 4 * self._throttle
        steers = _FIRST + 4 * self._steering
        if len(before) and self.registers[at + 2] | self.registers[at + 3]:
            self.esc.pulse(self._us(steers), self._us(at), self._clock())

    def _us(self, at: int) -> float:
        off = self.registers[at + 2] | self.registers[at + 3] << 8
        return off * (self.registers[_PRESCALE] + 1) / 25.0

    def _acknowledge(self) -> None:
        self.transfers += 1
        if self.unplugged or (self.nack_every is not None and self.transfers % self.nack_every == 0):
            raise OSError(errno.EREMOTEIO, "Remote I/O error")

    def _power_on(self) -> None:
        self.registers = bytearray(256)
        self.registers[_MODE1], self.registers[_PRESCALE] = _ASLEEP, _POWER_ON_PRESCALE

    def _close(self) -> None:
        self.open_buses -= 1


class Pca9685Bus:
    """One open bus with the chip on it."""

    def __init__(self, chip: Pca9685Chip, closed: Callable[[], None], *, answers: bool) -> None:
        self._chip, self._closed, self._answers = chip, closed, answers

    def write(self, data: bytes) -> None:
        """Write."""
        self._look()
        self._chip.write(data)

    def read(self, register: int, count: int) -> bytes:
        """Read."""
        self._look()
        return self._chip.read(register, count)

    def close(self) -> None:
        """Close."""
        self._closed()

    def _look(self) -> None:
        if not self._answers:
            raise OSError(errno.EREMOTEIO, "Remote I/O error")


class Pca9685Socket:
    """Serves a chip at a unix socket, one driver after the other (see `SocketI2cBus`).

    In a thread, because the driver waits for each transfer: the world's steps of some milliseconds are in the loop.
    """

    def __init__(self, chip: Pca9685Chip, path: Path) -> None:
        self._chip, self._path = chip, path
        path.unlink(missing_ok=True)
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._server.bind(str(path))
        self._server.listen(1)
        threading.Thread(target=self._serve, name="pca9685", daemon=True).start()

    def close(self) -> None:
        """Take no further connection."""
        with contextlib.suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)  # it ends the wait of the thread
        self._server.close()
        self._path.unlink(missing_ok=True)

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                driver, _ = self._server.accept()
                with driver, contextlib.suppress(OSError):
                    while request := driver.recv(PACKET_BYTES):
                        driver.send(self._answer(request[0], request[1], request[2:]))

    def _answer(self, chip: int, count: int, data: bytes) -> bytes:
        bus = self._chip.open(0, chip)
        try:
            if not count:
                bus.write(data)
                return bytes((0,))
            return bytes((0,)) + bus.read(data[0], count)
        except OSError as error:
            return bytes((error.errno or errno.EIO,))
        finally:
            bus.close()
