"""`wallride router`: a zenoh router with the configuration of a file, for computers without zenohd."""

import argparse
import json
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.ending import interrupted
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.endpoints import check_listening
from wallride.runtime.wire.router_config import router_config

COMMENT = "//"
KEY_FILES: Final = ("root_ca_certificate", "listen_certificate", "listen_private_key")


async def run(options: argparse.Namespace) -> int:
    """Route until SIGINT or SIGTERM; options as of `wallride.fleet.options`."""
    config = read_config(options.file) if options.file is not None else bench_config(options.listen)
    for words in _about_certificate(config, datetime.now(UTC)):
        options.print_line(words)
    bus = Bus(config)
    try:
        await bus.open()
    except OSError as error:
        raise ConnectionProblemError(f"the router cannot start: {error}") from None
    try:
        options.print_line(f"routing at {bus.endpoint}; Ctrl-C ends it")
        await interrupted()
    finally:
        await bus.close()
    return 0


def _about_certificate(config: dict[str, Any], now: datetime) -> Iterator[str]:
    """Yield why clients and cars will refuse this router, now or soon."""
    tls = config.get("transport", {}).get("link", {}).get("tls") or {}
    if "listen_certificate" not in tls:
        return
    try:
        from wallride.runtime.security.certificates import identity_in

        identity = identity_in(Path(tls["listen_certificate"]))
    except (ModuleNotFoundError, ValueError):  # a router needs no package for its keys; zenoh says what is damaged
        return
    if words := identity.trouble(now) or identity.warning(now):
        yield f"its certificate {words}; where the fleet's keys are: wallride keys router {identity.name} --renew"


def read_config(file: Path) -> dict[str, Any]:
    """Return the configuration that `wallride keys router` wrote, with the places of its keys; they must be there."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
        config = json.loads("\n".join(line for line in lines if not line.startswith(COMMENT)))
    except OSError as error:
        raise ConnectionProblemError(f"{file}: {error.strerror}; `wallride keys router NAME` writes one") from None
    except (RecursionError, ValueError):
        config = None
    if not isinstance(config, dict):
        raise _foreign(file)
    if missing := ", ".join(_missing(config)):
        raise ConnectionProblemError(
            f"{file}: has no {missing}: such a router refuses every client, or lets every client command every car;"
            " let `wallride keys router NAME` write the file"
        )
    try:
        _place_keys(config, file)
    except (AttributeError, TypeError):
        raise _foreign(file) from None
    return config


def _missing(config: dict[str, Any]) -> Iterator[str]:
    """Yield what a router's configuration lacks; zenoh's defaults for it accept every client, or none."""
    listen, control = config.get("listen"), config.get("access_control")
    if config.get("mode") != "router":
        yield 'mode "router"'
    if not isinstance(listen, dict) or not _are_endpoints(listen.get("endpoints")):
        yield "listen.endpoints"
    denies = {"enabled": True, "default_permission": "deny"}
    if not isinstance(control, dict) or {name: control.get(name) for name in denies} != denies:
        yield 'access_control that is enabled with default_permission "deny"'


def _are_endpoints(endpoints: object) -> bool:
    """Tell whether these are addresses of ours; zenoh reads options behind others, which undo the certificates."""
    if not isinstance(endpoints, list) or not endpoints:
        return False
    try:
        check_listening(endpoints)
    except (TypeError, ValueError):
        return False
    return True


def _place_keys(config: dict[str, Any], file: Path) -> None:
    """Replace names relative to the file by their places; ConnectionProblemError for a key that is not there."""
    tls = config.get("transport", {}).get("link", {}).get("tls") or {}
    for name in [name for name in KEY_FILES if name in tls]:
        place = file.absolute().parent / tls[name]
        try:
            place.open("rb").close()
        except FileNotFoundError:
            raise ConnectionProblemError(
                f"{file} names {tls[name]}, which is not there: copy the whole folder; or write it again with"
                f" `wallride keys router {file.stem} --dir DIR`, with --at FOLDER for a fixed place"
            ) from None
        except OSError as error:
            raise ConnectionProblemError(
                f"{place}, named in {file}: {error.strerror}; who runs it must read it"
            ) from None
        tls[name] = str(place)


def _foreign(file: Path) -> ConnectionProblemError:
    return ConnectionProblemError(f"{file}: is not what `wallride keys router` wrote; let it write the file again")


def bench_config(listen: str) -> dict[str, Any]:
    """Return the configuration of a router without keys, for this computer's own programs."""
    try:
        return router_config([listen], None, (), "bench")
    except ValueError as error:
        raise ConnectionProblemError(f"--listen {error}") from None
