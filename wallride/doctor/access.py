"""What others reach the car by: the session's port, certificates, the page's port."""

from collections.abc import Awaitable, Callable
from datetime import UTC, datetime

from wallride.doctor.computer import Computer
from wallride.doctor.findings import Finding, fail, ok, warn
from wallride.monitor_options import DEFAULT_PORT
from wallride.runtime.security.access_list import KeysError
from wallride.runtime.security.key_files import car_keys
from wallride.runtime.settings.tree import Settings
from wallride.runtime.wire.endpoints import is_tls, split_endpoint
from wallride.runtime.wire.port_holder import holder_of

Holder = Callable[[str], Awaitable[str]]


async def check_access(computer: Computer, settings: Settings, holder: Holder = holder_of) -> list[Finding]:
    """Look at ports and keys."""
    found = [await _endpoint(computer, endpoint, settings.car.name, holder) for endpoint in settings.telemetry.listen]
    return [*found, *_keys(computer, settings), _page(computer)]


async def _endpoint(computer: Computer, endpoint: str, car: str, holder: Holder) -> Finding:
    _, host, port = split_endpoint(endpoint)
    if computer.port_is_free(host, port):
        return ok("session port", f"{endpoint} is free")
    name = await holder(endpoint)
    if f"the car {car}" in name:
        return ok("session port", f"{endpoint}: {name} runs there")
    return fail(
        "session port", f"{endpoint} is taken by {name}",
        f"end that program, or let this car listen elsewhere: telemetry.listen = tcp/127.0.0.1:{port + 10}",
    )  # fmt: skip


def _keys(computer: Computer, settings: Settings) -> list[Finding]:
    telemetry = settings.telemetry
    if not any(map(is_tls, telemetry.listen)):
        return [ok("certificates", "none needed: only this computer may connect")]
    try:
        keys = car_keys(telemetry.keys_dir, datetime.fromtimestamp(computer.now_unix_s, UTC))
    except KeysError as error:
        words, _, remedy = str(error).rpartition("; ")
        return [fail("certificates", words or remedy, remedy if words else "sudo wallride keys init, or mend the file")]
    found = []
    for warning in keys.warnings:
        words, _, remedy = warning.rpartition("; ")
        found.append(warn("certificates", words, remedy))
    return found or [ok("certificates", f"valid until {keys.identity.expires:%Y-%m-%d}, {len(keys.people)} people")]


def _page(computer: Computer) -> Finding:
    if computer.port_is_free("127.0.0.1", DEFAULT_PORT):
        return ok("page port", f"{DEFAULT_PORT} is free")
    return warn(
        "page port", f"{DEFAULT_PORT} is taken, by `wallride monitor` or another program",
        "end it, or open the page elsewhere: wallride monitor --port 0",
    )  # fmt: skip
