"""Actions and output of `wallride keys`."""

import argparse
import json
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from wallride.clients.keys.folder import KeyFolder
from wallride.runtime.host.output_files import write_file
from wallride.runtime.realtime.wall_clock import FIRST_S
from wallride.runtime.security.access_list import AccessEntry, KeysError
from wallride.runtime.security.certificates import EXPIRES_SOON, CertificateIdentity, days_until, identity_in
from wallride.runtime.security.key_files import AUTHORITY, CAR, open_to_others
from wallride.runtime.wire.router_config import router_config
from wallride.runtime.wire.zenoh_config import Person, Role, Tls

SECURE_PORT = 7448
ROUTER_PORT = 7449
ROUTER_HEAD = (
    "// Written by `wallride keys router`, from the list of cars and people; made anew by it, so do not edit.\n"
)
ROUTERS = "a router reads the list when it starts: wallride keys router NAME --dir DIR again, then restart the router"
RESTART = "the car reads the list when it starts: sudo systemctl restart wallride"


def run(options: argparse.Namespace, car: str) -> list[str]:
    """Run the requested action and return the lines to print; KeysError with a remedy."""
    now = datetime.now(UTC)
    if now.timestamp() < FIRST_S and options.action in {"init", "add", "router"}:
        raise KeysError(f"this computer believes that it is {now:%Y-%m-%d}; set the clock (timedatectl), then again")
    actions = {"init": _init, "add": _add, "revoke": _revoke, "list": _list, "router": _router}
    try:
        return actions[options.action](options, car, now)
    except PermissionError as error:
        where = error.filename or options.dir
        raise KeysError(f"{where}: not permitted; use sudo, or another folder: --dir DIR") from None
    except OSError as error:
        where = error.filename or options.dir
        raise KeysError(f"{where}: {error.strerror or error}; name another folder: --dir DIR") from None


def _init(options: argparse.Namespace, car: str, now: datetime) -> list[str]:
    folder = KeyFolder(options.dir)
    names = folder.begin(car, options.san, now, options.days, renew=options.renew)
    return [
        f"{car} has keys in {options.dir}; keep ca.key to yourself, it signs the keys of every person",
        f"it can be reached as {', '.join(names)}",
        "next, who may do what:     wallride keys add NAME --role viewer|operator|admin",
        "and in the car's settings: [telemetry]",
        f'                           listen = ["tcp/127.0.0.1:7447", "tls/[::]:{SECURE_PORT}"]',
        f'                           keys_dir = "{options.dir.resolve()}"',
    ]


def _add(options: argparse.Namespace, _car: str, now: datetime) -> list[str]:
    person = Person(options.name, _role(options))
    folder = options.out or Path(f"{options.name}-keys")
    car = _car_identity(options.dir).name if (options.dir / f"{CAR}.pem").exists() else ""
    entry = KeyFolder(options.dir).add(person, folder, now, options.days, renew=options.renew)
    if not car:
        return _added_to_fleet(person, folder, entry)
    return [
        f"{person.name} is {_a(person.role)} of {car} until {entry.expires}; the keys are in {folder}",
        f"it identifies {person.name}: move it to their computer, as ~/.config/wallride/keys, and keep no copy",
        *_ended(entry),
        f"there:       wallride status --connect tls/{car}.local:{SECURE_PORT}",
        f"on this car: {RESTART}",
    ]


def _role(options: argparse.Namespace) -> Role:
    """Return the role that was named, or with --renew the one that the person has."""
    if options.role is not None:
        return Role(options.role)
    people = KeyFolder(options.dir).people() if options.renew else ()
    if known := next((one for one in people if one.person.name == options.name and one.revoked is None), None):
        return known.person.role
    raise KeysError(f"{options.name}: name a role: --role {'|'.join(Role)}")


def _added_to_fleet(person: Person, folder: Path, entry: AccessEntry) -> list[str]:
    place = "/etc/wallride/uplink" if person.role is Role.CAR else "~/.config/wallride/keys"
    whose = "that car's computer, readable by the service" if person.role is Role.CAR else "their computer"
    return [
        f"{person.name} is {_a(person.role)} of the fleet until {entry.expires}; the keys are in {folder}",
        f"it identifies {person.name}: move it to {whose}, as {place}, and keep no copy",
        *_ended(entry),
        f"next: {ROUTERS}",
    ]


def _ended(entry: AccessEntry) -> list[str]:
    name = entry.person.name
    return [f"keys that {name} had before end with the next start"] if entry.person.renewed else []


def _router(options: argparse.Namespace, _car: str, now: datetime) -> list[str]:
    """Write a router's folder: keys, and the configuration that follows from the list of cars and people."""
    fleet = KeyFolder(options.dir)
    folder, names = fleet.make_router(options.name, options.san, now, options.days, renew=options.renew)
    people = [entry.person for entry in fleet.people() if entry.revoked is None]
    there = options.at or Path()  # names relative to the folder go with it to any place
    tls = Tls(there / AUTHORITY, there / f"{options.name}.pem", there / f"{options.name}.key")
    listen = options.listen or [f"tls/[::]:{ROUTER_PORT}"]
    try:
        config = router_config(listen, tls, people, options.name, options.scan_hz)
    except ValueError as error:
        raise KeysError(f"--listen: {error}") from None
    file = folder / f"{options.name}.json5"
    write_file(file, f"{ROUTER_HEAD}{json.dumps(config, indent=2)}\n")
    cars = [person.name for person in people if person.role is Role.CAR]
    if options.at is not None:
        start = f"wallride router {there / file.name}   (or zenohd -c {there / file.name})"
    else:
        start = f"copy {folder} there, then wallride router {folder.name}/{file.name}"
        start += f"   (or cd {folder.name} && zenohd -c {file.name})"
    return [
        f"{file}: {len(cars)} cars, {len(people) - len(cars)} people; it can be reached as {', '.join(names)}",
        f"on its computer:       {start}",
        f'in each car\'s settings: [telemetry]  connect = ["tls/{options.name}.local:{ROUTER_PORT}"]',
        f"cars, people:          wallride keys add NAME --role ROLE --dir {options.dir}, then this again",
        *_about_router(folder / f"{options.name}.pem", now),
    ]


def _about_router(certificate: Path, now: datetime) -> list[str]:
    identity = identity_in(certificate)
    words = identity.trouble(now) or identity.warning(now)
    return [f"the router's certificate {words}: this with --renew, then copy the folder there"] if words else []


def _revoke(options: argparse.Namespace, car: str, now: datetime) -> list[str]:
    entry = KeyFolder(options.dir).revoke(options.name, now.date())
    if not (options.dir / f"{CAR}.pem").exists():
        return [f"{options.name} may do nothing in the fleet, since {entry.revoked}", ROUTERS]
    with suppress(KeysError):  # of a damaged certificate; the person is revoked by now
        car = _car_identity(options.dir).name
    return [f"{options.name} may do nothing on {car}, since {entry.revoked}", RESTART]


def _list(options: argparse.Namespace, car: str, now: datetime) -> list[str]:
    people = KeyFolder(options.dir).people()
    is_fleet = bool(people) and not (options.dir / f"{CAR}.pem").exists()
    identity = None if is_fleet else _car_identity(options.dir)
    if options.json:
        shown = {"car": _car_fields(identity)} if identity is not None else {}
        return json.dumps({**shown, "people": _people(people)}, indent=2).splitlines()
    width = max(len(name) for name in (*(entry.person.name for entry in people), *([] if is_fleet else [car])))
    lines = [f"{e.person.name:{width}}  {e.person.role:8}  {_state(e, now)}" for e in people]
    if identity is not None:
        ends = identity.trouble(now) or identity.warning(now) or f"until {identity.expires:%Y-%m-%d}"
        lines.insert(0, f"{identity.name:{width}}  car       {ends}; reached as {', '.join(identity.names)}")
    lines += open_to_others(options.dir)
    return lines if people else [*lines, "no other person: wallride keys add NAME --role viewer|operator|admin"]


def _people(people: Sequence[AccessEntry]) -> list[dict[str, Any]]:
    return [
        {
            "name": entry.person.name,
            "role": str(entry.person.role),
            "expires": str(entry.expires),
            "revoked": str(entry.revoked) if entry.revoked is not None else None,
        }
        for entry in people
    ]


def _car_fields(identity: CertificateIdentity) -> dict[str, Any]:
    return {"name": identity.name, "expires": f"{identity.expires:%Y-%m-%d}", "reached_as": list(identity.names)}


def _car_identity(directory: Path) -> CertificateIdentity:
    """Return the identity in the car's certificate; its key, readable only by its owner, is not needed."""
    try:
        return identity_in(directory / f"{CAR}.pem")
    except ValueError:
        raise KeysError(f"{directory / CAR}.pem: is not a certificate; wallride keys init --renew") from None


def _state(entry: AccessEntry, now: datetime) -> str:
    if entry.revoked is not None:
        return f"revoked {entry.revoked}"
    today = now.date()
    if entry.expires < today:
        return f"expired {entry.expires}"
    if entry.expires > today + EXPIRES_SOON:
        return f"until {entry.expires}"
    return f"until {entry.expires}, {days_until(entry.expires, today)}: keys add {entry.person.name} --renew"


def _a(role: Role) -> str:
    return f"a {role}" if role in {Role.VIEWER, Role.PLANNER, Role.CAR} else f"an {role}"
