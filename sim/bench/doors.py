"""Ways in and out for one client: a TCP port or a pseudo-terminal, blocking, without an event loop."""

import contextlib
import os
import socket
import tty
from pathlib import Path
from typing import Final, Protocol

READ_BYTES: Final = 4096


class Door(Protocol):
    """One client behind one descriptor. address: as the car's settings want it."""

    address: str

    @property
    def fd(self) -> int:
        """What to wait on."""
        ...

    def read(self) -> bytes | None:
        """Return what the client says, b"" when it has left, None when it has only just come."""
        ...

    def write(self, data: bytes) -> None:
        """Tell the client; returns when the kernel has all of it. Nobody there is no error."""
        ...

    def close(self) -> None:
        """Leave nothing open."""
        ...


class TcpDoor:
    """A TCP port of this machine."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._client: socket.socket | None = None
        self.address = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"

    @property
    def fd(self) -> int:
        """What to wait on."""
        return (self._client or self._listener).fileno()

    def read(self) -> bytes | None:
        """Return what the client says, b"" when it has left, None when it has only just come."""
        if self._client is None:
            self._client, _ = self._listener.accept()
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return None
        try:
            chunk = self._client.recv(READ_BYTES)
        except ConnectionError:
            chunk = b""
        if not chunk:
            self._client.close()
            self._client = None
        return chunk

    def write(self, data: bytes) -> None:
        """Tell the client; returns when the kernel has all of it."""
        if self._client is not None:
            with contextlib.suppress(ConnectionError):  # the car has gone; whoever measures it will notice
                self._client.sendall(data)

    def close(self) -> None:
        """Leave nothing open."""
        self._listener.close()
        if self._client is not None:
            self._client.close()


class PtyDoor:
    """A pseudo-terminal. What is written into it is handed over by a worker of the kernel, when the writer pauses."""

    def __init__(self, link: Path) -> None:
        self.fd, self._slave = os.openpty()
        tty.setraw(self._slave)
        link.symlink_to(os.ttyname(self._slave))
        self.address = f"serial://{link}"

    def read(self) -> bytes | None:
        """Return what the client says; it never leaves, because we hold its end open."""
        return os.read(self.fd, READ_BYTES)

    def write(self, data: bytes) -> None:
        """Tell the client."""
        os.write(self.fd, data)

    def close(self) -> None:
        """Leave nothing open."""
        os.close(self._slave)
        os.close(self.fd)
