"""Validation of three PEM files before zenoh loads them: zenoh itself reports nothing but "timeout".

Needs the package `cryptography` (extra `keys`); imported only where a tls endpoint is used.
"""

import os
import stat
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import TypeVar

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from wallride.runtime.security.access_list import KeysError
from wallride.runtime.wire.zenoh_config import Tls

EXPIRES_SOON = timedelta(days=30)
_Read = TypeVar("_Read")


@dataclass(frozen=True, slots=True)
class CertificateIdentity:
    """Identity in a certificate. `role` is the one it was issued for; the car's list decides about its rights."""

    name: str
    role: str
    names: tuple[str, ...]
    begins: datetime
    expires: datetime

    def trouble(self, now: datetime) -> str | None:
        """Return why it is not valid at this time, or None."""
        if now < self.begins:
            return f"is not valid before {self.begins:%Y-%m-%d}, and this computer believes that it is {now:%Y-%m-%d}"
        if now >= self.expires:
            return f"expired on {self.expires:%Y-%m-%d}"
        return None

    def warning(self, now: datetime) -> str | None:
        """Return a warning that it expires soon, or None."""
        if now < self.expires <= now + EXPIRES_SOON:
            return f"expires on {self.expires:%Y-%m-%d}, {days_until(self.expires.date(), now.date())}"
        return None


def days_until(day: date, today: date) -> str:
    """Return in words how far off a day is: today, in 1 day, in 2 days."""
    days = (day - today).days
    return f"in {days} day{'s' * (days > 1)}" if days else "today"


def read_identity(tls: Tls, *, for_car: bool) -> CertificateIdentity:
    """Check that the three files belong together and to this side; KeysError with the remedy.

    Validity in time is not checked here: a car whose clock is not set yet must still start.
    """
    authority = _read(tls.authority, x509.load_pem_x509_certificate, "certificate")
    certificate = _read(tls.certificate, x509.load_pem_x509_certificate, "certificate")
    key = _read(tls.key, lambda pem: load_pem_private_key(pem, password=None), "private key")
    _refuse_open_key(tls.key)
    if not isinstance(key, ec.EllipticCurvePrivateKey) or key.public_key() != certificate.public_key():
        raise KeysError(f"{tls.key} is not the key of {tls.certificate}: copy both from the same `wallride keys` run")
    try:
        certificate.verify_directly_issued_by(authority)
    except (ValueError, TypeError, InvalidSignature):
        raise KeysError(
            f"{tls.certificate} was not signed by {tls.authority} ({common_name(authority)}): these are files of "
            "two different cars; copy the whole folder of one"
        ) from None
    _check_purpose(certificate, tls.certificate, for_car=for_car)
    return identity_of(certificate)


def identity_in(path: Path) -> CertificateIdentity:
    """Return the identity in a certificate's file; ValueError where it holds none."""
    return identity_of(x509.load_pem_x509_certificate(path.read_bytes()))


def identity_of(certificate: x509.Certificate) -> CertificateIdentity:
    """Return the identity in a certificate."""
    try:
        alternatives = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        names = (
            *alternatives.get_values_for_type(x509.DNSName),
            *(str(address) for address in alternatives.get_values_for_type(x509.IPAddress)),
        )
    except x509.ExtensionNotFound:
        names = ()
    units = certificate.subject.get_attributes_for_oid(NameOID.ORGANIZATIONAL_UNIT_NAME)
    return CertificateIdentity(
        name=common_name(certificate).partition(".")[0],  # behind the dot: how often the keys were renewed
        role=str(units[0].value) if units else "",
        names=names,
        begins=certificate.not_valid_before_utc,
        expires=certificate.not_valid_after_utc,
    )


def common_name(certificate: x509.Certificate) -> str:
    """Return the whole name by which the car's access control identifies the holder."""
    names = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(names[0].value) if names else ""


def _check_purpose(certificate: x509.Certificate, path: Path, *, for_car: bool) -> None:
    """Refuse a person's certificate on a car and the reverse; zenoh would report a timeout."""
    try:
        usage = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    except x509.ExtensionNotFound:
        return
    wanted = ExtendedKeyUsageOID.SERVER_AUTH if for_car else ExtendedKeyUsageOID.CLIENT_AUTH
    if wanted not in usage:
        is_for = "a person" if for_car else "a car"
        needs = "`wallride keys init`" if for_car else "a folder from `wallride keys add NAME`"
        raise KeysError(f"{path} is the certificate of {is_for}; what is needed here comes from {needs}")


def _read(path: Path, parse: Callable[[bytes], _Read], what: str) -> _Read:
    try:
        return parse(path.read_bytes())
    except FileNotFoundError:
        raise KeysError(
            f"{path}: no such file; on the car `wallride keys init`, then `wallride keys add NAME`"
        ) from None
    except PermissionError:
        raise KeysError(f"{path}: this user may not read it; {_who_may(path)}") from None
    except OSError as error:
        raise KeysError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, TypeError, UnsupportedAlgorithm):
        raise KeysError(f"{path}: is not a {what} in PEM that wallride made; copy it again") from None


def _who_may(path: Path) -> str:
    try:
        owner = f"it belongs to user {path.owner()} and group {path.group()}"
        return f"{owner}; for the service: sudo chgrp wallride {path} && sudo chmod g+r {path}"
    except (OSError, KeyError, NotImplementedError):
        return "check its owner and mode"


def _refuse_open_key(path: Path) -> None:
    """Refuse a private key that every account of the computer can read."""
    if os.name == "posix" and path.stat().st_mode & (stat.S_IROTH | stat.S_IWOTH):
        raise KeysError(f"{path}: every user of this computer can read this key; chmod o-rwx {path}")
