"""Ports of an emulated sensor: a TCP port, or a serial port under a name that stays.

Both provide a `BytePort`, one non-blocking descriptor whose unsent bytes are bounded.
"""

import asyncio
import fcntl
import os
import pty
import socket
import struct
import termios
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Final

_READ_BYTES: Final = 4096
_DRIBBLE_TICK_S: Final = 0.001


class BytePort:
    """One client's descriptor. Bytes that the kernel does not take at once are queued, up to `limit_bytes`."""

    def __init__(
        self, fd: int, on_bytes: Callable[[bytes], None], on_gone: Callable[[], None], *, limit_bytes: int = 1 << 21
    ) -> None:
        self._fd = fd
        self._on_bytes = on_bytes
        self._on_gone = on_gone
        self._limit_bytes = limit_bytes
        self._waiting = bytearray()
        self._timer: asyncio.TimerHandle | None = None
        self._bytes_per_tick = 0
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(fd, self._on_readable)

    @property
    def busy(self) -> bool:
        """Return whether earlier bytes are still queued."""
        return bool(self._waiting)

    def send(self, data: bytes, *, spread_s: float | None = None) -> bool:
        """Send; True once the kernel has all bytes, False if some are queued (or there is no room for them at all).

        spread_s: byte by byte, one write each, over about this time.
        """
        if self._waiting or spread_s is not None:
            if len(self._waiting) + len(data) <= self._limit_bytes:
                self._waiting += data
                self._wait(spread_s)
            return False
        self._waiting += data[self._write(data) :]
        if self._waiting:
            self._wait(None)
        return not self._waiting

    def close(self) -> None:
        """Stop listening and drop the queue; the owner closes the descriptor."""
        self._loop.remove_reader(self._fd)
        self._loop.remove_writer(self._fd)
        if self._timer:
            self._timer.cancel()
            self._timer = None
        self._waiting.clear()

    def _wait(self, spread_s: float | None) -> None:
        if spread_s is None:
            self._loop.add_writer(self._fd, self._drain)
            return
        self._bytes_per_tick = 1 + int(len(self._waiting) * _DRIBBLE_TICK_S / max(spread_s, _DRIBBLE_TICK_S))
        if self._timer is None:
            self._timer = self._loop.call_later(0, self._dribble)

    def _dribble(self) -> None:
        self._timer = None
        for _ in range(min(self._bytes_per_tick, len(self._waiting))):
            if not self._write(bytes(self._waiting[:1])):
                break
            del self._waiting[:1]
        if self._waiting:
            self._timer = self._loop.call_later(_DRIBBLE_TICK_S, self._dribble)

    def _drain(self) -> None:
        del self._waiting[: self._write(bytes(self._waiting))]
        if not self._waiting:
            self._loop.remove_writer(self._fd)

    def _write(self, data: bytes) -> int:
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            return 0
        except OSError:  # the client is gone; the reader receives the error too and reports it
            return len(data)

    def _on_readable(self) -> None:
        try:
            chunk = os.read(self._fd, _READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            chunk = b""
        if chunk:
            self._on_bytes(chunk)
        else:
            self._on_gone()


class TcpPort:
    """Listens for one client at a time; further ones are accepted only when the first is gone, like on the sensor."""

    def __init__(self, on_client: Callable[[int], None], is_taken: Callable[[], bool]) -> None:
        self._on_client = on_client
        self._is_taken = is_taken
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None
        self._where = ("127.0.0.1", 0)

    def open(self, host: str, port: int) -> int:
        """Listen and return the port; 0 takes a free one, which stays reserved across close and reopen."""
        self._where = (host, port)
        return self.reopen()

    def reopen(self) -> int:
        """Listen (again) on the same port; idempotent."""
        if self._listener is None:
            self._listener = socket.create_server(self._where, backlog=4)
            self._listener.setblocking(False)  # noqa: FBT003
            asyncio.get_running_loop().add_reader(self._listener, self._accept)
            self._where = self._listener.getsockname()[:2]
        return self._where[1]

    def shut(self) -> None:
        """Refuse new clients."""
        if self._listener is not None:
            asyncio.get_running_loop().remove_reader(self._listener)
            self._listener.close()
            self._listener = None

    def drop(self) -> None:
        """Close the client's connection."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def _accept(self) -> None:
        if self._listener is None:
            return
        try:
            client, _ = self._listener.accept()
        except (BlockingIOError, ConnectionError):
            return
        if self._is_taken() and not self._has_left():
            client.close()
            return
        self.drop()
        client.setblocking(False)  # noqa: FBT003
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = client
        self._on_client(client.fileno())

    def _has_left(self) -> bool:
        """Return whether the client hung up without a report yet: its successor may be accepted first."""
        if self._client is None:
            return True
        try:
            return self._client.recv(1, socket.MSG_PEEK) == b""
        except BlockingIOError:
            return False
        except OSError:
            return True


class SerialDoor:
    """A pseudo-terminal in raw mode behind a symbolic link, so that the device has the same name after a replug.

    It keeps the client's end open as well: without it its own end would report hang-up while no client has the port
    open.
    """

    def __init__(self, link: Path) -> None:
        self._link = link
        self._ours: int | None = None
        self._theirs: int | None = None

    def plug(self) -> int:
        """Create the port; return the emulator's end."""
        self.unplug()
        self._ours, self._theirs = pty.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        fresh = self._link.with_name(self._link.name + ".new")
        fresh.unlink(missing_ok=True)
        fresh.symlink_to(os.ttyname(self._theirs))
        fresh.replace(self._link)  # in one step, as udev does
        return self._ours

    def unplug(self) -> None:
        """Remove the port: a client with the port open gets an I/O error."""
        if self._ours is not None and self._theirs is not None:
            os.close(self._theirs)
            os.close(self._ours)
            self._link.unlink(missing_ok=True)
        self._ours = self._theirs = None

    def baud(self) -> int | None:
        """Return the speed set by the client."""
        if self._theirs is None:
            return None
        speed = termios.tcgetattr(self._theirs)[5]
        usual = next((baud for baud in _BAUDS if getattr(termios, f"B{baud}") == speed), None)
        return self._other_baud() if usual is None else usual

    def _other_baud(self) -> int | None:
        """Return a speed for which POSIX has no name; Linux tells it in the last field of termios2."""
        assert self._theirs is not None  # noqa: S101 - the caller has looked
        try:
            told = fcntl.ioctl(self._theirs, _TCGETS2, bytes(_TERMIOS2.size))
        except OSError:
            return None
        return int(_TERMIOS2.unpack(told)[-1])

    def allow_reopening(self) -> None:
        """Clear a client's exclusive lock, which on a real port ends when the client closes it."""
        if self._theirs is not None:
            fcntl.ioctl(self._theirs, termios.TIOCNXCL)


_TCGETS2: Final = 0x802C542A
_TERMIOS2: Final = struct.Struct("@IIIIB19BII")
_BAUDS: Final = (9600, 19200, 38400, 57600, 115200, 230400)
