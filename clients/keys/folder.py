"""The folder of keys on the car: makes it, adds to it, takes from it. Files are replaced whole or not at all.

All is written by the folder's descriptor, under a lock, and only where no other user may change the folder: run by
root, a name in a folder of another user may lead to any file by the time that it is opened.

A fleet has the same folder without a car: ca.key, ca.pem, people.toml, and a folder for each router.

ca.key       signs; readable by its owner only, and not by the service that drives the car
ca.pem       what all sides trust               car.pem car.key   what the car shows
people.toml  who may do what
"""

import contextlib
import fcntl
import grp
import os
import re
import socket
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import date, datetime
from pathlib import Path

from wallride.clients.keys.authority import Authority, KeyPair
from wallride.runtime.security.access_list import CAR_FORM, AccessEntry, KeysError, name_trouble, read_people
from wallride.runtime.security.certificates import CertificateIdentity, identity_in
from wallride.runtime.security.key_files import AUTHORITY, AUTHORITY_KEY, CAR, PEOPLE, open_to_others
from wallride.runtime.wire.zenoh_config import Person, Role

SERVICE_GROUP = "wallride"
HEAD = "# Who may do what on this car. Written by `wallride keys`; the car reads it when it starts.\n"
_HOST_FORM = re.compile(r"[A-Za-z0-9_](?:[A-Za-z0-9._-]{0,251}[A-Za-z0-9])?|[0-9A-Fa-f:.]+")


class KeyFolder:
    """Folder of one car's keys. Every method raises KeysError with a remedy; `now` is the civil time with a zone."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._place = -1

    def people(self) -> tuple[AccessEntry, ...]:
        """Return every person ever added, in order."""
        return read_people(self.path / PEOPLE)

    @contextlib.contextmanager
    def _alone(self, *, make: bool = False) -> Iterator[None]:
        """Hold the folder while it is read, changed and written; refuse one that others may change."""
        if make:
            self.path.mkdir(mode=0o755, parents=True, exist_ok=True)
        elif not self.path.is_dir():
            raise KeysError(f"{self.path}: has no keys yet; begin with `wallride keys init`")
        if found := open_to_others(self.path):
            raise KeysError(f"nothing was written: {found[0]}")
        with _opened(self.path) as self._place:
            lock = os.open(".lock", os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600, dir_fd=self._place)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX)
                yield
            finally:
                os.close(lock)

    def begin(self, car: str, names: Sequence[str], now: datetime, days: int, *, renew: bool) -> list[str]:
        """Make the authority and the car's certificate, whichever is missing; return the names the car goes by."""
        if not CAR_FORM.fullmatch(car):
            raise KeysError(f"{car}: is not a car's name; 1 to 32 of a-z, 0-9, _ and -, as in car.name of its settings")
        with self._alone(make=True):
            if not self._make_authority(car, now) and (self.path / f"{CAR}.pem").exists() and not renew:
                raise KeysError(
                    f"{self.path}: has keys already; --renew makes the car's certificate anew, people keep theirs"
                )
            alternatives = names_of_car(car, [*_added(_made(self.path / f"{CAR}.pem")), *names])
            pair = self._authority().certify_car(car, alternatives, now, days)
            _store(self._place, CAR, pair, group=_service_group())
            if not (self.path / PEOPLE).exists():
                self._write_people(())
            return alternatives

    def make_router(
        self, name: str, names: Sequence[str], now: datetime, days: int, *, renew: bool
    ) -> tuple[Path, list[str]]:
        """Make a router's folder, and the fleet's authority where it is missing; return it and its names.

        Keys that are there stay unless `renew`, which keeps their names and adds new ones; the folder holds all that
        goes to the router's computer.
        """
        if not CAR_FORM.fullmatch(name):
            raise KeysError(f"{name}: is not a router's name; 1 to 32 of a-z, 0-9, _ and -")
        if (self.path / f"{CAR}.pem").exists():
            raise KeysError(f"{self.path}: holds the keys of one car; a fleet has a folder of its own: --dir DIR")
        with self._alone(make=True):
            self._make_authority("fleet", now)
            if not (self.path / PEOPLE).exists():
                self._write_people(())
            folder = self.path / name
            folder.mkdir(mode=0o700, exist_ok=True)
            made = _made(folder / f"{name}.pem")
            alternatives = names_of_car(name, [*_added(made), *names])
            if made is not None and not renew:
                alternatives = list(made.names)
                if new := [one for one in names if one not in made.names]:
                    raise KeysError(f"{folder}: has a certificate without {', '.join(new)}; --renew makes it anew")
            with _opened(folder) as place:
                if made is None or renew:
                    _store(place, name, self._authority().certify_car(name, alternatives, now, days))
                _write(place, AUTHORITY, (self.path / AUTHORITY).read_bytes(), 0o644)
            return folder, alternatives

    def add(self, person: Person, folder: Path, now: datetime, days: int, *, renew: bool) -> AccessEntry:
        """Make a person's keys in a new folder and list them."""
        if trouble := name_trouble(person.name, person.role):
            raise KeysError(f"{person.name}: {trouble}")
        if person.name in {CAR, Path(AUTHORITY).stem}:
            raise KeysError(f"{person.name}: is what the car's own files are called; take another name")
        if person.role is Role.CAR and (self.path / f"{CAR}.pem").exists():
            raise KeysError(
                f"{self.path}: holds the keys of one car; a car is added to a fleet: `wallride keys router`"
            )
        with self._alone():
            others, before = self._others(person.name, now.date(), renew=renew)
            if before is not None:
                person = replace(person, renewed=before.person.renewed + 1)
            if folder.exists():
                raise KeysError(f"{folder}: is there already; move it away, or choose another one with --out")
            pair = self._authority().certify_person(person.common_name, person.role, now, days)
            folder.mkdir(mode=0o700, parents=True)
            with _opened(folder) as place:
                _store(place, person.name, pair)
                _write(place, AUTHORITY, (self.path / AUTHORITY).read_bytes(), 0o644)
                _give_to_caller(place)
            entry = AccessEntry(person, expires=date.fromordinal(now.date().toordinal() + days))
            self._write_people((*others, entry))  # last: unlisted keys give no access
            return entry

    def revoke(self, name: str, today: date) -> AccessEntry:
        """Revoke all rights of a person, whatever certificate is shown."""
        with self._alone():
            people = self.people()
            entry = next((entry for entry in people if entry.person.name == name), None)
            if entry is None:
                known = ", ".join(entry.person.name for entry in people) or "none"
                raise KeysError(f"{name}: is not in {self.path / PEOPLE}; there is {known}")
            if entry.revoked is None:
                entry = AccessEntry(entry.person, entry.expires, revoked=today)
                self._write_people([entry if other.person.name == name else other for other in people])
            return entry

    def _others(self, name: str, today: date, *, renew: bool) -> tuple[list[AccessEntry], AccessEntry | None]:
        """Return the other people and the name's entry so far; its old certificate ends only on purpose."""
        people = self.people()
        before = next((entry for entry in people if entry.person.name == name), None)
        if before is not None and today <= before.expires and not renew:
            state = f"revoked on {before.revoked}" if before.revoked is not None else f"as {before.person.role}"
            raise KeysError(
                f"{name}: is there already, {state}; --renew for new keys or another role: the old keys end by it"
            )
        return [entry for entry in people if entry is not before], before

    def _make_authority(self, name: str, now: datetime) -> bool:
        """Make the authority where it is missing; tell whether it was."""
        made = [(self.path / file).exists() for file in (AUTHORITY, AUTHORITY_KEY)]
        if made[0] != made[1]:
            raise KeysError(f"{self.path}: has only one of {AUTHORITY} and {AUTHORITY_KEY}; restore the other one")
        if made[0]:
            return False
        pair = Authority.make(name, now)
        _write(self._place, AUTHORITY_KEY, pair.key_pem, 0o600)
        _write(self._place, AUTHORITY, pair.certificate_pem, 0o644)
        return True

    def _authority(self) -> Authority:
        try:
            return Authority(KeyPair((self.path / AUTHORITY).read_bytes(), (self.path / AUTHORITY_KEY).read_bytes()))
        except FileNotFoundError as error:
            if (self.path / AUTHORITY).exists():
                raise KeysError(f"{error.filename}: is not here; put it back where it is needed to make keys") from None
            raise KeysError(f"{self.path}: has no keys yet; begin with `wallride keys init`") from None

    def _write_people(self, people: Sequence[AccessEntry]) -> None:
        lines = [HEAD]
        for entry in people:
            lines.append(f'\n[{entry.person.name}]\nrole = "{entry.person.role}"\nexpires = {entry.expires}\n')
            if entry.person.renewed:
                lines.append(f"renewed = {entry.person.renewed}\n")
            if entry.revoked is not None:
                lines.append(f"revoked = {entry.revoked}\n")
        _write(self._place, PEOPLE, "".join(lines).encode(), 0o644)


def _made(file: Path) -> CertificateIdentity | None:
    """Return the identity in a certificate that is there; None for a damaged one, which is made anew."""
    try:
        return identity_in(file) if file.exists() else None
    except ValueError:
        return None


def _added(made: CertificateIdentity | None) -> list[str]:
    """Return the names that a certificate has by --san."""
    if made is None:
        return []
    usual = names_of_car(made.name, ())
    return [name for name in made.names if name not in usual]


def names_of_car(car: str, more: Sequence[str]) -> list[str]:
    """Return every name under which clients may look for the car, once each."""
    for name in more:
        if not _HOST_FORM.fullmatch(name):
            raise KeysError(f"--san {name}: is neither a host name nor an IP address")
        if ":" in name:  # zenoh compares the brackets as well
            raise KeysError(f"--san {name}: a certificate cannot be checked against an IPv6 address; use a name")
    host = socket.gethostname().split(".")[0].lower()
    hosts = [host, f"{host}.local"] if _HOST_FORM.fullmatch(host) else []
    return list(dict.fromkeys([car, f"{car}.local", *hosts, "localhost", "127.0.0.1", *more]))


@contextlib.contextmanager
def _opened(folder: Path) -> Iterator[int]:
    """Open a folder, not by a link that another user put in its place, and check whose it is."""
    place = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        if os.fstat(place).st_uid not in {0, os.geteuid()}:
            raise KeysError(f"{folder}: another user put a folder of their own there; nothing was written into it")
        yield place
    finally:
        os.close(place)


def _store(place: int, name: str, pair: KeyPair, *, group: int | None = None) -> None:
    """Write key and certificate; group: may read the key."""
    _write(place, f"{name}.key", pair.key_pem, 0o600 if group is None else 0o640, group)
    _write(place, f"{name}.pem", pair.certificate_pem, 0o644)


def _write(place: int, name: str, content: bytes, mode: int, group: int | None = None) -> None:
    """Write a file so that a power cut leaves the old or the new one, and no key can be read before its mode is set."""
    draft = f"{name}.new"
    with contextlib.suppress(FileNotFoundError):
        os.unlink(draft, dir_fd=place)
    made = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600, dir_fd=place)
    with os.fdopen(made, "wb") as file:
        file.write(content)
        file.flush()
        if group is not None:
            os.fchown(made, -1, group)
        os.fchmod(made, mode)
        os.fsync(made)
    os.replace(draft, name, src_dir_fd=place, dst_dir_fd=place)


def _service_group() -> int | None:
    """Return the service's group, which has to read the car's key; None where there is none, or this is not root."""
    if os.geteuid() == 0:
        with contextlib.suppress(KeyError):
            return grp.getgrnam(SERVICE_GROUP).gr_gid
    return None


def _give_to_caller(folder: int) -> None:
    """Under sudo, give the new folder to the calling user, who has to carry it away.

    The files first and the folder last, each by its descriptor: from the moment that the folder is the user's, its
    names may be links to anything.
    """
    if os.geteuid() == 0 and (user := os.environ.get("SUDO_UID", "")).isdigit():
        group = os.environ.get("SUDO_GID", user)
        owner = int(user), int(group) if group.isdigit() else -1
        for name in os.listdir(folder):
            file = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=folder)
            try:
                os.fchown(file, *owner)
            finally:
                os.close(file)
        os.fchown(folder, *owner)
