"""Access control of the monitor. A page can drive a car, so other sites in the same browser must not be able to. Pure.

* Host: the requested name must be the server's. A site whose own name points to this machine (DNS rebinding) is
  requested by that name, and is rejected.
* Origin: the browser's statement of the page that opens a WebSocket. Only this server's page may.
* Token: where other machines can reach the port, the address itself has to be known.
"""

import hmac
import ipaddress
import socket
from dataclasses import dataclass

LOCAL_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True, slots=True)
class PageAuth:
    """Requirements of every request.

    names: hosts that are us; numbers: whether any address written in digits is us too (we listen on all of them).
    token: what the address must carry, "" where only this machine can come.
    """

    names: frozenset[str]
    numbers: bool = False
    token: str = ""

    def objection(self, host: str, token: str) -> str:
        """Return the reason for rejecting a request, "" when it is accepted. host: the Host header."""
        name = host_name(host)
        if not (name in self.names or (self.numbers and _is_number(name))):
            return "this is not the address of a wallride monitor; use the one that `wallride monitor` printed"
        if self.token and not hmac.compare_digest(token.encode(), self.token.encode()):
            return "the address lacks its token; use the whole address that `wallride monitor` printed"
        return ""

    def socket_objection(self, host: str, origin: str, token: str) -> str:
        """Return the reason for rejecting a WebSocket. origin: the Origin header, "" without one."""
        if origin.lower() != f"http://{host.lower()}":
            return "only the page that came from here may talk to the car"
        return self.objection(host, token)


def open_door(host: str, token: str) -> PageAuth:
    """Return the access control of a server on a host; token: required where other machines can reach it."""
    if is_loopback(host):
        return PageAuth(LOCAL_NAMES)
    name = socket.gethostname().lower()
    ours = {host.lower(), name, f"{name}.local", name.split(".")[0]}
    return PageAuth(LOCAL_NAMES | ours, numbers=True, token=token)


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach a host."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def host_name(header: str) -> str:
    """Return the name in a Host header, without its port and brackets: the port may be a tunnel's."""
    if header.startswith("["):
        return header[1:].partition("]")[0].lower()
    return header.partition(":")[0].lower()


def _is_number(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
