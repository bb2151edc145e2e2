"""Configurations of zenoh sessions as plain dictionaries: the car's and its clients'. Pure: no zenoh, no files.

The car is a router of its own, so that users install nothing; whoever talks to it is a client of exactly that car.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

LEASE_MS = 1000
KEEP_ALIVES_PER_LEASE = 4
CONNECT_TIMEOUT_MS = 1000


class Role(StrEnum):
    """What a person may do; each role includes the ones before it."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMIN = "admin"


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody with a certificate: its common name, and what it may do."""

    name: str
    role: Role


@dataclass(frozen=True, slots=True)
class Tls:
    """The three PEM files that a session shows and trusts."""

    authority: Path
    certificate: Path
    key: Path


def car_config(listen: Sequence[str], tls: Tls | None, people: Sequence[Person], car: str) -> dict[str, Any]:
    """Return the configuration of the car's session, which listens and never connects anywhere."""
    return _session("router", car) | {
        "listen": {"endpoints": list(listen)},
        "connect": {"endpoints": []},
        "timestamping": {"enabled": True},
    }


def client_config(connect: str, tls: Tls | None) -> dict[str, Any]:
    """Return the configuration of a client's session: one car, found again within half a second when it vanished."""
    return _session("client", None) | {
        "connect": {
            "endpoints": [connect],
            "timeout_ms": CONNECT_TIMEOUT_MS,
            "exit_on_failure": True,
            "retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5},
        },
    }


def _session(mode: str, name: str | None) -> dict[str, Any]:
    """Return what both ends share: nothing is searched for on the network, and silence is noticed within a second."""
    return {
        "mode": mode,
        "metadata": {"name": name},
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "link": {"tx": {"lease": LEASE_MS, "keep_alive": KEEP_ALIVES_PER_LEASE}},
            "shared_memory": {"enabled": False},
        },
    }
