"""The folder of keys: on the car ca.pem car.pem car.key people.toml, at a person's ca.pem NAME.pem NAME.key."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wallride.runtime.host.extras import how_to_install
from wallride.runtime.host.ownership import changed_by_others
from wallride.runtime.security.access_list import KeysError, read_people
from wallride.runtime.wire.endpoints import is_tls
from wallride.runtime.wire.rmw_zenoh import RosAccess
from wallride.runtime.wire.router_config import uplink_config
from wallride.runtime.wire.zenoh_config import Person, Role, Tls, car_config

if TYPE_CHECKING:
    from wallride.runtime.security.certificates import CertificateIdentity

PEOPLE = "people.toml"
AUTHORITY = "ca.pem"
AUTHORITY_KEY = "ca.key"
CAR = "car"


@dataclass(frozen=True, slots=True)
class KeyFiles:
    """Checked key files: their owner, and the warnings for that owner."""

    tls: Tls
    identity: "CertificateIdentity"
    warnings: tuple[str, ...] = ()
    people: tuple[Person, ...] = ()


def car_session(
    listen: Sequence[str], directory: Path, car: str, now: datetime, ros: RosAccess | None = None
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the configuration of the car's session and the warnings about the keys for its owner.

    ros: the car's ROS 2 keys, if any. Key files are read only when a tls endpoint needs them; KeysError when they
    cannot be used.
    """
    if not any(map(is_tls, listen)):
        return car_config(listen, None, (), car, ros), ()
    keys = car_keys(directory, now)
    return car_config(listen, keys.tls, keys.people, car, ros), keys.warnings


def uplink_sessions(
    connect: Sequence[str], directory: Path, car: str, now: datetime, planners: Sequence[str], highest: Role
) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Return the configurations of the car's sessions with routers, and the warnings about the keys.

    planners, highest: as in `uplink_config`. KeysError when the keys cannot be used, or are those of another name; as
    with `car_keys`, one that is not valid *now* is a warning.
    """
    tls: Tls | None = None
    warnings: tuple[str, ...] = ()
    if any(map(is_tls, connect)):
        keys, trouble = _persons_keys(directory, now)
        if keys.identity.name != car:
            raise KeysError(
                f"{keys.tls.certificate} is for {keys.identity.name}, and this car is {car}: a router would let it say"
                f" nothing; `wallride keys add {car} --role car` where the fleet's keys are"
            )
        tls, warnings = keys.tls, (f"nothing goes to a router: {trouble}",) if trouble else keys.warnings
    return [uplink_config(endpoint, tls, car, planners, highest) for endpoint in connect], warnings


def car_keys(directory: Path, now: datetime) -> KeyFiles:
    """Check the car's folder and read the access list; KeysError when the car must not listen with it.

    now: the civil time, with a zone. A certificate that is not valid *now* is only a warning, because a car without
        network often starts with a wrong clock, and must start.
    """
    tls = Tls(directory / AUTHORITY, directory / f"{CAR}.pem", directory / f"{CAR}.key")
    identity = _identity(tls, for_car=True)
    people = tuple(entry.person for entry in read_people(directory / PEOPLE) if entry.revoked is None)
    warnings = []
    if trouble := identity.trouble(now):
        remedy = "set the clock" if now < identity.begins else f"sudo wallride keys init --renew --dir {directory}"
        warnings.append(f"no client can connect with keys: the car's certificate {tls.certificate} {trouble}; {remedy}")
    if warning := identity.warning(now):
        warnings.append(f"the car's certificate {tls.certificate} {warning}; sudo wallride keys init --renew")
    warnings += open_to_others(directory)
    if not people:
        warnings.append(f"no person is listed in {directory / PEOPLE}; `wallride keys add NAME --role operator`")
    return KeyFiles(tls, identity, tuple(warnings), people)


def open_to_others(directory: Path) -> list[str]:
    """Return a sentence for each way in which other users of this computer can make themselves keys or rights."""
    files = [directory / name for name in (PEOPLE, AUTHORITY, AUTHORITY_KEY, f"{CAR}.pem", f"{CAR}.key")]
    there = [path for path in (directory, *files) if path.exists()]
    found = [
        f"{why}, which lets others grant rights and exchange keys; look at the content, then chown root and chmod go-w"
        for why in dict.fromkeys(filter(None, map(changed_by_others, there)))
    ]
    key = directory / AUTHORITY_KEY
    if key in there and key.stat().st_mode & 0o077:
        found.append(f"{key}: other users may read this key, which signs keys of every person; chmod go-rwx {key}")
    return found


def client_keys(directory: Path, now: datetime) -> KeyFiles:
    """Find and check a person's folder; KeysError when no car would accept it."""
    keys, trouble = _persons_keys(directory, now)
    if trouble:
        raise KeysError(trouble)
    return keys


def _persons_keys(directory: Path, now: datetime) -> tuple[KeyFiles, str]:
    """Find and check a person's or a fleet car's folder; return its keys, and why they are not valid now, "" if so."""
    tls = _persons_files(directory)
    identity = _identity(tls, for_car=False)
    renew = f"where it was made: wallride keys add {identity.name} --renew"
    warnings = (f"{tls.certificate} {warning}; {renew}",) if (warning := identity.warning(now)) else ()
    trouble = identity.trouble(now)
    remedy = "set the clock" if now < identity.begins else renew
    return KeyFiles(tls, identity, warnings), f"{tls.certificate} {trouble}; {remedy}" if trouble else ""


def _persons_files(directory: Path) -> Tls:
    if not directory.is_dir():
        raise KeysError(f"{directory}: no such folder; put the one there that `wallride keys add NAME` made on the car")
    keys = sorted(directory.glob("*.key"))
    if len(keys) != 1:
        found = "no key" if not keys else f"{len(keys)} keys ({', '.join(key.stem for key in keys)})"
        raise KeysError(f"{directory}: holds {found} instead of one; keep one folder per person and car: --keys DIR")
    return Tls(directory / AUTHORITY, keys[0].with_suffix(".pem"), keys[0])


def _identity(tls: Tls, *, for_car: bool) -> "CertificateIdentity":
    """Check the files with the package that only keys need; name the way to install it when it is missing."""
    try:
        from wallride.runtime.security.certificates import read_identity
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != "cryptography":
            raise
        raise KeysError(f"keys need one more package: {how_to_install('keys')}") from None
    return read_identity(tls, for_car=for_car)
