"""Addresses of devices, as they stand in the settings. Pure: nothing is opened here (see `link`).

tcp://192.168.0.10:10940
serial:///dev/wallride-lidar?baud=115200
"""

from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

_LOOPBACK = frozenset({"127.0.0.1", "::1"})
_USUAL_FORMS = "write tcp://HOST:PORT or serial:///dev/NAME?baud=115200"


@dataclass(frozen=True, slots=True)
class TcpAddress:
    """A device with a network socket."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcp://{self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class SerialAddress:
    """A device behind a serial port, real or USB. USB ports ignore the baud rate."""

    path: str
    baud: int = 115200

    def __str__(self) -> str:
        return f"serial://{self.path}?baud={self.baud}"


Address = TcpAddress | SerialAddress


def parse_address(text: str) -> Address:
    """Parse an address; ValueError names the error and the expected form."""
    parts = urlsplit(text)
    if parts.scheme == "tcp":
        return _parse_tcp(text)
    if parts.scheme == "serial":
        return _parse_serial(text)
    raise ValueError(f"{text!r} is not an address: {_USUAL_FORMS}")


def at_hand(text: str, remedy: str = "") -> str:
    """Return the address of a motor: a serial port, or a TCP port of this same computer, as of a bridge or an emulator.

    ValueError, with the remedy, for another computer: brakes go over no network.
    """
    address = parse_address(text)
    if isinstance(address, TcpAddress) and address.host not in _LOOPBACK:
        raise ValueError(f"{text!r} is another computer, and a brake must not depend on a network{remedy}")
    return text


def _parse_tcp(text: str) -> TcpAddress:
    parts = urlsplit(text)
    try:
        host, port = parts.hostname, parts.port
    except ValueError:
        raise ValueError(f"{text!r} has no port between 1 and 65535: {_USUAL_FORMS}") from None
    if not host or not port:
        raise ValueError(f"{text!r} needs a host and a port: {_USUAL_FORMS}")
    if parts.path not in {"", "/"} or parts.query:
        raise ValueError(f"{text!r} has something after the port: {_USUAL_FORMS}")
    return TcpAddress(host, port)


def _parse_serial(text: str) -> SerialAddress:
    parts = urlsplit(text)
    if parts.netloc or not parts.path.startswith("/") or parts.path == "/":
        raise ValueError(f"{text!r} needs three slashes and a device path: {_USUAL_FORMS}")
    options = parse_qs(parts.query, keep_blank_values=True)
    unknown = sorted(set(options) - {"baud"})
    if unknown:
        raise ValueError(f"{text!r} has an unknown option {unknown[0]!r}; the only one is baud: {_USUAL_FORMS}")
    baud = options.get("baud", ["115200"])[-1]
    if not baud.isdecimal() or int(baud) <= 0:
        raise ValueError(f"{text!r} has baud {baud!r}, which is not a positive number: {_USUAL_FORMS}")
    return SerialAddress(parts.path, int(baud))
