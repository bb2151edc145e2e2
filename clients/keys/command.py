"""Actions and output of `wallride keys`."""

import argparse
import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cryptography import x509

from clients.keys.folder import KeyFolder
from runtime.security.access_list import AccessEntry, KeysError
from runtime.security.certificates import EXPIRES_SOON, CertificateIdentity, identity_of
from runtime.security.key_files import CAR
from runtime.wire.zenoh_config import Person, Role

SECURE_PORT = 7448
RESTART = "the car reads the list when it starts: sudo systemctl restart wallride"


def run(options: argparse.Namespace, car: str) -> list[str]:
    """Run the requested action and return the lines to print; KeysError with a remedy."""
    actions = {"init": _init, "add": _add, "revoke": _revoke, "list": _list}
    try:
        return actions[options.action](options, car, datetime.now(UTC))
    except PermissionError as error:
        where = error.filename or options.dir
        raise KeysError(f"{where}: not permitted; use sudo, or another folder: --dir DIR") from None
    except OSError as error:
        raise KeysError(f"{error.filename or options.dir}: {error.strerror or error}") from None


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


def _add(options: argparse.Namespace, car: str, now: datetime) -> list[str]:
    person = Person(options.name, Role(options.role))
    folder = options.out or Path(f"{options.name}-keys")
    entry = KeyFolder(options.dir).add(person, folder, now, options.days, renew=options.renew)
    return [
        f"{person.name} is {_a(person.role)} of {car} until {entry.expires}; the keys are in {folder}",
        f"it identifies {person.name}: move it to their computer, as ~/.config/wallride/keys, and keep no copy",
        f"there:       wallride status --connect tls/{car}.local:{SECURE_PORT}",
        f"on this car: {RESTART}",
    ]


def _revoke(options: argparse.Namespace, car: str, now: datetime) -> list[str]:
    entry = KeyFolder(options.dir).revoke(options.name, now.date())
    return [f"{options.name} may do nothing on {car}, since {entry.revoked}", RESTART]


def _list(options: argparse.Namespace, car: str, now: datetime) -> list[str]:
    people = KeyFolder(options.dir).people()
    width = max([len(car), *(len(entry.person.name) for entry in people)])
    identity = _car_identity(options.dir)
    if options.json:
        return [json.dumps(_listing(identity, people), indent=2)]
    ends = identity.trouble(now) or identity.warning(now) or f"until {identity.expires:%Y-%m-%d}"
    lines = [f"{identity.name:{width}}  car       {ends}; reached as {', '.join(identity.names)}"]
    lines += [f"{e.person.name:{width}}  {e.person.role:8}  {_state(e, now)}" for e in people]
    return lines if people else [*lines, "no other person: wallride keys add NAME --role viewer|operator|admin"]


def _listing(identity: CertificateIdentity, people: Sequence[AccessEntry]) -> dict[str, Any]:
    return {
        "car": {
            "name": identity.name,
            "expires": f"{identity.expires:%Y-%m-%d}",
            "reached_as": list(identity.names),
        },
        "people": [
            {
                "name": entry.person.name,
                "role": str(entry.person.role),
                "expires": str(entry.expires),
                "revoked": str(entry.revoked) if entry.revoked is not None else None,
            }
            for entry in people
        ],
    }


def _car_identity(directory: Path) -> CertificateIdentity:
    """Return the identity in the car's certificate; its key, readable only by its owner, is not needed."""
    try:
        return identity_of(x509.load_pem_x509_certificate((directory / f"{CAR}.pem").read_bytes()))
    except ValueError:
        raise KeysError(f"{directory / CAR}.pem: is not a certificate; wallride keys init --renew") from None


def _state(entry: AccessEntry, now: datetime) -> str:
    if entry.revoked is not None:
        return f"revoked {entry.revoked}"
    days = (entry.expires - now.date()).days
    if days < 0:
        return f"expired {entry.expires}"
    return f"until {entry.expires}" + (
        f", in {days} days: keys add {entry.person.name} --renew" if days <= EXPIRES_SOON.days else ""
    )


def _a(role: Role) -> str:
    return f"a {role}" if role in {Role.VIEWER, Role.PLANNER} else f"an {role}"
