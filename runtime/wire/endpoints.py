"""Endpoints of a session: `tcp/127.0.0.1:7447`, `tls/[::]:7448`. Pure text; settings and clients share it.

Only two kinds exist. `tcp` has no access control, so the car offers it on its own loopback only; everything else is
`tls`.
"""

import re
from collections.abc import Sequence

LOOPBACK = ("127.0.0.1", "[::1]")
_EVERYWHERE = ("0.0.0.0", "[::]")  # noqa: S104 - only with TLS, and only compared here
# No "#" and no "?": zenoh would read options behind them, and one of them disables the certificates.
_FORM = re.compile(r"(?P<protocol>tcp|tls)/(?P<host>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):(?P<port>\d{1,5})")
_EXAMPLES = "write tcp/127.0.0.1:7447, or tls/car1.local:7448"


def split_endpoint(endpoint: str) -> tuple[str, str, int]:
    """Return protocol, host (an IPv6 address keeps its brackets) and port; ValueError when it is not an endpoint."""
    match = _FORM.fullmatch(endpoint)
    if match is None:
        raise ValueError(f"{endpoint} is not an address that wallride knows; {_EXAMPLES}")
    if not 1 <= (port := int(match["port"])) <= 65535:
        raise ValueError(f"{endpoint}: there is no port {port}; ports are 1 to 65535")
    return match["protocol"], match["host"], port


def is_tls(endpoint: str) -> bool:
    """Tell whether an endpoint presents and requires certificates."""
    return split_endpoint(endpoint)[0] == "tls"


def check_listening(endpoints: Sequence[str]) -> None:
    """Refuse endpoints on which a car must not listen: ValueError with the remedy."""
    taken: dict[int, tuple[str, str]] = {}
    for endpoint in endpoints:
        protocol, host, port = split_endpoint(endpoint)
        if protocol == "tcp" and host not in LOOPBACK:
            raise ValueError(
                f"{endpoint} would let anyone on the network drive: tcp is for this machine only "
                f"(tcp/127.0.0.1:{port}); for others listen on tls/{host}:{port} and run `wallride keys init`"
            )
        other, other_host = taken.setdefault(port, (endpoint, host))
        if other != endpoint and (host in _EVERYWHERE or other_host in (*_EVERYWHERE, host)):
            raise ValueError(f"{other} and {endpoint} want the same port; give the tls one {port + 1}")
    if len(set(endpoints)) < len(endpoints):
        raise ValueError("names the same address twice; name it once")
