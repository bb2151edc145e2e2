"""A motor controller at a local socket in place of a pseudo-terminal, to measure on a busy machine.

What is written to a pseudo-terminal waits for a worker of the kernel that has ordinary priority: with both cores busy
it came 615 ms late here, beside 0.1 ms for a socket. Run as a program, this is `wallride` with such a motor port:

    python -m tests.system.socket_motor run ...
"""

import asyncio
import os
import socket
import sys

from wallride.drivers import link
from wallride.drivers.api import LinkLost
from wallride.drivers.vesc import codec
from wallride.sim.devices.vesc import VescEmulator


class SocketVesc(VescEmulator):
    """The emulated controller; its port is a local socket at `link`."""

    def start(self) -> None:
        """Listen; one host at a time."""
        self._loop = asyncio.get_running_loop()
        self._deframer = codec.VescDeframer()
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(self.link))
        self._listener.listen()
        self._listener.setblocking(False)
        self._loop.add_reader(self._listener, self._accept)

    def unplug(self) -> None:
        """Close the port; its name is gone. Harmless when repeated."""
        self._drop_host()
        if self._listener.fileno() >= 0:
            self._loop.remove_reader(self._listener)
            self._listener.close()
            self.link.unlink(missing_ok=True)

    def _drop_host(self) -> None:
        if self._master is not None:
            self._loop.remove_reader(self._master)
            os.close(self._master)
            self._master = None

    def _accept(self) -> None:
        self._drop_host()
        host, _ = self._listener.accept()
        host.setblocking(False)
        self._master = host.detach()
        self._loop.add_reader(self._master, self._on_readable)
        self.deaf = self.deaf  # a new host does not make it hear

    def _on_readable(self) -> None:
        assert self._master is not None
        try:
            data = os.read(self._master, 4096)
        except ConnectionResetError:  # the car was killed
            data = b""
        if not data:
            self._loop.remove_reader(self._master)
        for payload in self._deframer.feed(data):
            self._on_payload(payload)


def _open_socket(address, clock, *, dtr=True):
    port = socket.socket(socket.AF_UNIX)
    try:
        port.connect(address.path)
    except OSError as error:
        port.close()
        raise LinkLost(f"{address}: {error.strerror}") from error
    port.setblocking(False)
    return link.ByteLink(address, port.fileno(), lambda _lost: port.close(), clock)


def use_sockets() -> None:
    """Let this process take the serial port that its settings name for a local socket."""
    link._open_serial = _open_socket


if __name__ == "__main__":
    use_sockets()
    from wallride.cli import main

    sys.exit(main())
