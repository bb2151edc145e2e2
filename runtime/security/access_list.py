"""people.toml: the access list of this car. Written by `wallride keys`, read when the car starts.

A certificate only proves a name. A name that is not listed, or is revoked, has no rights, however long its certificate
is still valid.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from wallride.runtime.wire.zenoh_config import Person, Role

NAME_FORM = re.compile(r"[a-z0-9][a-z0-9_-]{0,23}")
"""Form of a person's name: it is a key in TOML, a file's name everywhere, and fits a teleop message."""
CAR_FORM = re.compile(r"[a-z0-9][a-z0-9_-]{0,31}")
"""Form of a car's or router's name, that of `car.name`; a certificate takes twice as much."""


class KeysError(Exception):
    """Keys that cannot be used; the text names the problem, the place, and the remedy."""


@dataclass(frozen=True, slots=True)
class AccessEntry:
    """One entry of people.toml; `expires` is the day on which the newest certificate ends."""

    person: Person
    expires: date
    revoked: date | None = None


def read_people(path: Path) -> tuple[AccessEntry, ...]:
    """Read people.toml; KeysError when anything in it is not understood, because a guess could grant rights."""
    try:
        entries = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise KeysError(f"{path}: no such file; `wallride keys init` makes it") from None
    except OSError as error:
        raise KeysError(f"{path}: cannot be read ({error.strerror}); check its owner and mode") from None
    except (RecursionError, ValueError) as error:  # ValueError: of TOML, of text, of a number of 5000 digits
        raise KeysError(f"{path}: is not valid TOML: {error}") from None
    return tuple(_listed(path, name, entry) for name, entry in entries.items())


def _listed(path: Path, name: str, entry: object) -> AccessEntry:
    if not isinstance(entry, Mapping) or set(entry) - {"role", "expires", "revoked", "renewed"}:
        raise KeysError(f"{path}: [{name}] may have role, expires, revoked and renewed, and nothing else")
    try:
        role = Role(entry["role"])
    except (KeyError, ValueError):
        raise KeysError(f"{path}: [{name}] role must be one of {', '.join(Role)}") from None
    if trouble := name_trouble(name, role):
        raise KeysError(f"{path}: [{name}] {trouble}")
    expires, revoked = entry.get("expires"), entry.get("revoked")
    if type(expires) is not date or type(revoked) not in {date, type(None)}:
        raise KeysError(f"{path}: [{name}] expires and revoked must be dates like 2027-05-01, without quotes")
    renewed = entry.get("renewed", 0)
    if type(renewed) is not int or renewed < 0:
        raise KeysError(f"{path}: [{name}] renewed must be a number, of the times that the keys were renewed")
    return AccessEntry(Person(name, role, renewed), expires, revoked)


def name_trouble(name: str, role: Role) -> str:
    """Return why someone of this role cannot have a name, with the rule; "" for one that is right."""
    form, characters = (CAR_FORM, 32) if role is Role.CAR else (NAME_FORM, 24)
    if form.fullmatch(name):
        return ""
    what = "a car's name" if role is Role.CAR else "a name"
    return f"is not {what}; names are 1 to {characters} of a-z, 0-9, _ and -, beginning with a letter or digit"
