"""Settings of the car's session, endpoints and keys, and of its parameter server."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator

from wallride.drivers.section import Section
from wallride.runtime.wire.endpoints import check_listening
from wallride.runtime.wire.router_config import check_routers

DEFAULT_KEYS_DIR = Path("/etc/wallride/keys")
DEFAULT_CONNECT_KEYS_DIR = Path("/etc/wallride/uplink")


class SessionSettings(Section):
    """Settings of the zenoh session, a part of the [telemetry] section."""

    listen: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    """Endpoints. tcp: this computer only, all of its programs have every right. tls: any computer, with keys."""
    any_port: bool = False
    """Listen on a free port where one of `listen` is in use, for simulators; false: end with exit code 2."""
    keys_dir: Path = DEFAULT_KEYS_DIR
    """Folder of keys from `wallride keys init`; used with a tls endpoint only."""

    connect: tuple[str, ...] = ()
    """Routers of a fleet to which the car connects, so that viewers load them and not the car (docs/fleet.md)."""
    connect_keys_dir: Path = DEFAULT_CONNECT_KEYS_DIR
    """Folder of this car's keys at the routers, from `wallride keys add CAR --role car`; used with tls routers only."""
    connect_role: Literal["viewer", "operator", "admin"] = "operator"
    """Rights that a router may pass on to this car at most; viewer: it passes on nothing that moves the car."""

    @field_validator("listen", "connect", mode="before")
    @classmethod
    def _one_or_several(cls, endpoints: object) -> object:
        return (endpoints,) if isinstance(endpoints, str) else endpoints

    @field_validator("connect")
    @classmethod
    def _known(cls, connect: tuple[str, ...]) -> tuple[str, ...]:
        check_routers(connect)
        return connect

    @field_validator("listen")
    @classmethod
    def _guarded(cls, listen: tuple[str, ...]) -> tuple[str, ...]:
        check_listening(listen)
        return listen


class ParameterSettings(Section):
    """Bounds of the history of live changes."""

    history: Annotated[int, Field(ge=1, le=1000)] = 100
    """Number of remembered changes."""
    history_file: str = ""
    """File of the changes, written at most once a second; empty: in memory only."""

    @property
    def history_path(self) -> Path | None:
        """The file of the changes, None without one."""
        return Path(self.history_file) if self.history_file else None
