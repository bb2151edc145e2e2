"""Notifications to systemd: READY, WATCHDOG, STATUS (sd_notify protocol, datagrams to the socket in $NOTIFY_SOCKET)."""

import os
import socket
from collections.abc import Mapping


class ServiceManager:
    """Inactive without a service manager, and never raises: driving must not depend on it."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket: socket.socket | None = None
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setblocking(False)  # noqa: FBT003 - the standard library's own signature
        self._status = ""

    def ready(self) -> None:
        """Report the end of the start-up."""
        self._send("READY=1")

    def alive(self) -> None:
        """Notify the watchdog: call this only after a healthy cycle of the control loop."""
        self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """Report a requested end."""
        self._send("STOPPING=1")

    def status(self, text: str) -> None:
        """Show a line in `systemctl status`, once per change."""
        if text != self._status:
            self._status = text
            self._send(f"STATUS={text}")

    def close(self) -> None:
        """Release the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, message: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(message.encode(), self._address)
        except OSError:
            return  # a full or vanished socket is the service manager's problem; its watchdog then ends this process
