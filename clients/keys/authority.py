"""Certificates: the car's own authority, the car, and people. No files here; bytes out.

A person's certificate is good for clients only and a car's for servers only, so that no viewer can pose as the car.
Elliptic curve P-256 and SHA-256, which every TLS library has.
"""

import ipaddress
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID, ObjectIdentifier

from wallride.runtime.security.access_list import KeysError

AUTHORITY_DAYS = 3650
BACKDATED = timedelta(days=1)
"""Clocks of small computers are late; a certificate made a minute ago must not lie in their future."""


@dataclass(frozen=True, slots=True)
class KeyPair:
    """A certificate and its private key, both PEM; `key_pem` is not encrypted and must not be readable by others."""

    certificate_pem: bytes
    key_pem: bytes


class Authority:
    """Signs certificates with one private key."""

    def __init__(self, pair: KeyPair) -> None:
        try:
            self._certificate = x509.load_pem_x509_certificate(pair.certificate_pem)
            key = load_pem_private_key(pair.key_pem, password=None)
        except (ValueError, TypeError):
            raise KeysError("ca.pem or ca.key is not a file that `wallride keys init` made; restore both") from None
        if not isinstance(key, ec.EllipticCurvePrivateKey) or key.public_key() != self._certificate.public_key():
            raise KeysError("ca.key is not the key of ca.pem; restore both from the same backup")
        self._key = key

    @classmethod
    def make(cls, car: str, now: datetime) -> KeyPair:
        """Return a new authority for one car."""
        key = ec.generate_private_key(ec.SECP256R1())
        name = _name(f"{car} keys")
        return _signed(
            _builder(name, name, key.public_key(), now, now + timedelta(days=AUTHORITY_DAYS))
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(_usage(signs_certificates=True), critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False),
            key,
            key,
        )

    def certify_car(self, car: str, names: Iterable[str], now: datetime, days: int) -> KeyPair:
        """Return the certificate under which clients reach the car: by any of `names`, DNS names or IP addresses."""
        alternatives = x509.SubjectAlternativeName([_general_name(name) for name in names])
        return self._certify(_name(car), ExtendedKeyUsageOID.SERVER_AUTH, [alternatives], now, days)

    def certify_person(self, name: str, role: str, now: datetime, days: int) -> KeyPair:
        """Return a person's certificate; the role is in it only to be shown, the car goes by its own list."""
        return self._certify(_name(name, role), ExtendedKeyUsageOID.CLIENT_AUTH, [], now, days)

    def _certify(
        self,
        subject: x509.Name,
        purpose: ObjectIdentifier,
        extensions: Sequence[x509.ExtensionType],
        now: datetime,
        days: int,
    ) -> KeyPair:
        key = ec.generate_private_key(ec.SECP256R1())
        expires = now + timedelta(days=days)
        if expires > self._certificate.not_valid_after_utc:
            end = self._certificate.not_valid_after_utc
            remedy = (
                "take fewer --days" if end > now + timedelta(days=1)
                else "move the folder away, and begin anew: `wallride keys init` or `router`, then `add` for everyone"
            )  # fmt: skip
            raise KeysError(f"the authority that signs the keys itself ends on {end:%Y-%m-%d}; {remedy}")
        builder = _builder(subject, self._certificate.subject, key.public_key(), now, expires)
        for extension in [
            x509.BasicConstraints(ca=False, path_length=None),
            x509.ExtendedKeyUsage([purpose]),
            x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key()),
            *extensions,
        ]:
            builder = builder.add_extension(extension, critical=isinstance(extension, x509.BasicConstraints))
        return _signed(builder.add_extension(_usage(signs_certificates=False), critical=True), key, self._key)


def _name(common_name: str, unit: str = "") -> x509.Name:
    parts = [x509.NameAttribute(NameOID.COMMON_NAME, common_name)]
    if unit:
        parts.append(x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, unit))
    return x509.Name([x509.NameAttribute(NameOID.ORGANIZATION_NAME, "wallride"), *parts])


def _general_name(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def _builder(
    subject: x509.Name,
    issuer: x509.Name,
    public_key: ec.EllipticCurvePublicKey,
    now: datetime,
    expires: datetime,
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(public_key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - BACKDATED)
        .not_valid_after(expires)
    )


def _usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _signed(
    builder: x509.CertificateBuilder, key: ec.EllipticCurvePrivateKey, signer: ec.EllipticCurvePrivateKey
) -> KeyPair:
    certificate = builder.sign(signer, hashes.SHA256())
    return KeyPair(
        certificate.public_bytes(Encoding.PEM),
        key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()),
    )
