"""Settings of the car's session: endpoints and keys."""

from pathlib import Path

from pydantic import field_validator

from runtime.settings_base import Section
from runtime.wire.endpoints import check_listening

DEFAULT_KEYS_DIR = Path("/etc/wallride/keys")


class SessionSettings(Section):
    """Settings of the zenoh session, a part of the [telemetry] section."""

    listen: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    """Endpoints. tcp: this computer only, all of its programs have every right. tls: any computer, with keys."""
    any_port: bool = False
    """Listen on a free port where one of `listen` is in use, for simulators; false: end with exit code 2."""
    keys_dir: Path = DEFAULT_KEYS_DIR
    """Folder of keys from `wallride keys init`; used with a tls endpoint only."""

    @field_validator("listen", mode="before")
    @classmethod
    def _one_or_several(cls, listen: object) -> object:
        return (listen,) if isinstance(listen, str) else listen

    @field_validator("listen")
    @classmethod
    def _guarded(cls, listen: tuple[str, ...]) -> tuple[str, ...]:
        check_listening(listen)
        return listen
