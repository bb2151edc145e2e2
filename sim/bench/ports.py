"""Port for one client: TCP, blocking, without an event loop."""

import contextlib
import socket
from typing import Final

READ_BYTES: Final = 4096


class BenchTcpPort:
    """TCP port of this machine. address: in the form of the car's settings."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._client: socket.socket | None = None
        self.address = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"

    @property
    def fd(self) -> int:
        """Return the descriptor to wait on."""
        return (self._client or self._listener).fileno()

    def read(self) -> bytes | None:
        """Return the client's bytes, b"" when it has left, None when it has only just connected."""
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
        """Write to the client; returns when the kernel has all of it."""
        if self._client is not None:
            with contextlib.suppress(ConnectionError):  # the car has gone; the measurement will notice
                self._client.sendall(data)

    def close(self) -> None:
        """Close all descriptors."""
        self._listener.close()
        if self._client is not None:
            self._client.close()
