"""Ports of endpoints: a free one, and whether another program has one."""

import errno
import socket
from typing import Any

from wallride.runtime.wire.endpoints import split_endpoint


def free_endpoint() -> str:
    """Return a loopback endpoint whose port is free at this moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def is_taken(endpoint: str) -> bool:
    """Tell whether another program listens on an endpoint's port."""
    _, host, port = split_endpoint(endpoint)
    try:
        places = socket.getaddrinfo(host.strip("[]"), port, type=socket.SOCK_STREAM)
    except OSError:
        return False
    return any(_is_bound(family, place) for family, _, _, _, place in places)


def _is_bound(family: int, place: Any) -> bool:  # noqa: ANN401 - the socket module's own form of an address
    with socket.socket(family) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(place)
        except OSError as error:
            return error.errno == errno.EADDRINUSE
    return False
