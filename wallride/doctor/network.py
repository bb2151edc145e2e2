"""The way to a lidar with a TCP address: interface, route, own addresses. From /proc and /sys, nothing is sent."""

import ipaddress
from dataclasses import dataclass
from typing import Final

from wallride.doctor.computer import Computer
from wallride.doctor.findings import Finding, fail, ok, warn
from wallride.drivers.address import TcpAddress, parse_address
from wallride.runtime.settings.tree import Settings

SUBJECT: Final = "lidar network"
_COLUMNS: Final = 8


@dataclass(frozen=True, slots=True)
class Route:
    """A line of /proc/net/route. gateway: None where the network is reached directly."""

    interface: str
    network: ipaddress.IPv4Network
    gateway: ipaddress.IPv4Address | None


def check_network(computer: Computer, settings: Settings) -> list[Finding]:
    """Look at the way to the lidar; nothing to say of one on a serial port."""
    text = getattr(settings.lidar, "address", None)  # an own driver's way is its own affair
    address = parse_address(text) if text is not None else None
    if not isinstance(address, TcpAddress):
        return []
    try:
        host = ipaddress.ip_address(address.host)
    except ValueError:
        return [ok(SUBJECT, f"{address.host} is a name; its route is not looked at")]
    if host.is_loopback:
        return [ok(SUBJECT, f"{address.host} is this computer")]
    if not isinstance(host, ipaddress.IPv4Address):
        return [ok(SUBJECT, f"{address.host} is an IPv6 address; its route is not looked at")]
    return [_way(computer, host)]


def routes(table: str) -> list[Route]:
    """Read /proc/net/route; lines that are none are left out."""
    found = []
    for line in table.splitlines()[1:]:
        columns = line.split()
        if len(columns) >= _COLUMNS:
            gateway = _address(columns[2])
            network = ipaddress.IPv4Network((_address(columns[1]), str(_address(columns[7]))), strict=False)
            found.append(Route(columns[0], network, gateway if int(gateway) else None))
    return found


def own_addresses(trie: str) -> set[ipaddress.IPv4Address]:
    """Return this computer's addresses from /proc/net/fib_trie: leaves that are followed by "/32 host LOCAL"."""
    found, leaf = set(), ""
    for line in trie.splitlines():
        words = line.split()
        if words[:1] == ["|--"]:
            leaf = words[1]
        elif words == ["/32", "host", "LOCAL"]:
            found.add(ipaddress.IPv4Address(leaf))
    return found


def _way(computer: Computer, host: ipaddress.IPv4Address) -> Finding:
    spare = _spare(host)
    if host in own_addresses(computer.text("/proc/net/fib_trie")):
        return fail(
            SUBJECT, f"this computer itself has the lidar's address {host}",
            f"give its Ethernet port another one, like {spare}",
        )  # fmt: skip
    table = routes(computer.text("/proc/net/route"))
    if any(route.gateway == host for route in table):
        return warn(
            SUBJECT, f"the lidar {host} is this computer's gateway, so that nothing else can be reached",
            "remove the gateway from the Ethernet port: sudo nmcli connection modify NAME ipv4.gateway '' "
            "ipv4.never-default yes",
        )  # fmt: skip
    direct = [route for route in table if route.gateway is None and host in route.network]
    if not direct:
        return fail(
            SUBJECT, f"no interface has an address in the lidar's network ({host})",
            f"give the Ethernet port one, without a gateway: sudo nmcli connection modify NAME ipv4.method manual "
            f"ipv4.addresses {spare} ipv4.never-default yes",
        )  # fmt: skip
    return _interfaces(computer, host, sorted({route.interface for route in direct}))


def _interfaces(computer: Computer, host: ipaddress.IPv4Address, names: list[str]) -> Finding:
    wireless = [name for name in names if computer.path(f"/sys/class/net/{name}/wireless").exists()]
    if len(names) > 1:
        return warn(
            SUBJECT, f"{' and '.join(names)} are both in the lidar's network ({host})",
            "renumber one of the two networks, so that the lidar is looked for on its cable",
        )  # fmt: skip
    if wireless:
        return fail(
            SUBJECT, f"{host} is looked for on the Wi-Fi {wireless[0]}",
            f"give the Ethernet port an address like {_spare(host)}, and let the Wi-Fi use another network",
        )  # fmt: skip
    if computer.text(f"/sys/class/net/{names[0]}/carrier") == "0":
        return fail(SUBJECT, f"{names[0]}: no cable, or the lidar has no power", "plug the cable in, power the lidar")
    return ok(SUBJECT, f"{host} over {names[0]}")


def _spare(host: ipaddress.IPv4Address) -> str:
    """Return an address for this computer in the lidar's network."""
    network = ipaddress.IPv4Network((host, 24), strict=False)
    return f"{network.network_address + (15 if int(host) % 256 != 15 else 16)}/24"


def _address(text: str) -> ipaddress.IPv4Address:
    return ipaddress.IPv4Address(int.from_bytes(bytes.fromhex(text), "little"))
