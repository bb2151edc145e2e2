"""Access control of a web server. A page can drive a car, so other sites in the same browser must not be able to. Pure.

* Host: the requested name must be the server's. A site whose own name points to this machine (DNS rebinding) is
  requested by that name, and is rejected.
* Origin: the browser's statement of the page that opens a WebSocket. Only this server's page may, or pages that are
  named; a site that hides its name ("null") is none of them.
* Token: the address itself has to be known, on this machine too: its other users reach the port as well.
"""

import hmac
import ipaddress
import re
import socket
from dataclasses import dataclass

_HOST = re.compile(r"(?:\[(?P<number>[0-9A-Fa-f:.]+)\]|(?P<name>[A-Za-z0-9._-]+))(?::\d{1,5})?")
LOCAL_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True, slots=True)
class DoorAuth:
    """Requirements of every request.

    names: hosts that are us; numbers: whether any address written in digits is us too (we listen on all of them).
    token: what the address must carry. command: which prints the address.
    pages: origins that may open a WebSocket beside our own page; None stands for a program that is no browser.
    """

    names: frozenset[str]
    token: str
    numbers: bool = False
    command: str = "monitor"
    pages: frozenset[str | None] = frozenset()

    def objection(self, host: str, token: str) -> str:
        """Return the reason for rejecting a request, "" when it is accepted. host: the Host header."""
        name = host_name(host)
        if not (name in self.names or (self.numbers and _is_number(name))):
            return f"this is not the address of a wallride {self.command}; use the one that {self._printed}"
        if not hmac.compare_digest(token.encode(), self.token.encode()):
            return f"the address lacks its token; use the whole address that {self._printed}"
        return ""

    def socket_objection(self, host: str, origin: str | None, token: str) -> str:
        """Return the reason for rejecting a WebSocket. origin: the Origin header, None without one."""
        page = origin.lower() if origin is not None else None
        if page not in self.pages and page != f"http://{host.lower()}":
            more = "; another page that you trust: --page" if self.pages else ""
            return f"only the page that came from here may talk to the car{more}"
        return self.objection(host, token)

    @property
    def _printed(self) -> str:
        return f"`wallride {self.command}` printed"


def door_auth(
    host: str, token: str, *, command: str = "monitor", pages: frozenset[str | None] = frozenset()
) -> DoorAuth:
    """Return the access control of a server on a host; the rest as in `DoorAuth`."""
    if is_loopback(host):
        return DoorAuth(LOCAL_NAMES, token, command=command, pages=pages)
    name = socket.gethostname().lower()
    ours = {host.lower(), name, f"{name}.local", name.split(".")[0]}
    return DoorAuth(LOCAL_NAMES | ours, token, numbers=True, command=command, pages=pages)


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach a host."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def host_name(header: str) -> str:
    """Return the name in a Host header, without its port and brackets, "" for what is none; its port may be a tunnel's.

    Anything between the closing bracket and the port would be part of another name.
    """
    match = _HOST.fullmatch(header)
    return (match["number"] or match["name"]).lower() if match is not None else ""


def _is_number(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
