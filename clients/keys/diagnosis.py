"""Diagnosis of a rejected tls connection. zenoh reports "timeout" for every cause; here one handshake is made directly.

Only after zenoh failed, only with the standard library, and nothing is sent beyond the handshake.
"""

import socket
import ssl

from wallride.runtime.wire.endpoints import split_endpoint
from wallride.runtime.wire.zenoh_config import Tls

_EXPIRED, _NOT_YET_VALID, _WRONG_NAME, _WRONG_ADDRESS = 10, 9, 62, 64
"""X509_V_ERR_... of OpenSSL, x509_vfy.h"""
_OTHER_CAR = "it does not know who signed your certificate: your keys are for another car, or from before its `init`"
_ALERTS = {
    "CERTIFICATE_EXPIRED": "it says that your certificate has expired: renew it, or set the car's clock",
    "UNKNOWN_CA": _OTHER_CAR,
    "DECRYPT_ERROR": _OTHER_CAR,  # the same name of the authority, and another key
    "UNSUPPORTED_CERTIFICATE": "yours is not a person's certificate; use a folder from `wallride keys add NAME`",
    "CERTIFICATE_REQUIRED": "it wants a certificate; name your folder with --keys",
}


def why_refused(endpoint: str, tls: Tls, *, timeout_s: float = 2.0) -> str:
    """Return one sentence; blocks for up to `timeout_s`, so call it in a thread."""
    _, host, port = split_endpoint(endpoint)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        context.load_verify_locations(tls.authority)
        context.load_cert_chain(tls.certificate, tls.key)
        with (
            socket.create_connection((host.strip("[]"), port), timeout_s) as plain,
            context.wrap_socket(plain, server_hostname=host.strip("[]")) as guarded,
        ):
            return _after_handshake(endpoint, guarded)
    except ssl.SSLCertVerificationError as error:
        return _about_the_car(endpoint, error)
    except ssl.SSLError as error:
        return _about_us(endpoint, error)
    except socket.gaierror:
        return f"{endpoint}: no computer {host} is known; is the car on and in this network? Its IP address works too"
    except TimeoutError:
        return f"{endpoint}: no answer; is the car on and in this network, and no firewall between?"
    except ConnectionRefusedError:
        return f"{endpoint}: the computer is there, but nothing listens; does telemetry.listen have tls/[::]:{port}?"
    except (OSError, ValueError) as error:  # ValueError: a name that no computer can have
        return f"{endpoint}: {getattr(error, 'strerror', None) or error}"


def nothing_heard(name: str, endpoint: str) -> str:
    """Explain an open session without a car: the car does not answer names that it does not list."""
    return (
        f"{endpoint} let {name} in and says nothing: {name} is revoked or not listed there (on the car: wallride keys "
        "list), or the car was not restarted since"
    )


def _after_handshake(endpoint: str, guarded: ssl.SSLSocket) -> str:
    """Read the verdict of the other side, which in TLS 1.3 judges our certificate after our handshake ended."""
    guarded.settimeout(0.5)
    try:
        guarded.recv(1)
    except TimeoutError:
        pass  # it waits for zenoh's first message: the certificates are fine
    except ssl.SSLError as error:
        return _about_us(endpoint, error)
    except ConnectionResetError:
        return f"{endpoint}: closed at once; the car may have refused your certificate, its log says why"
    return f"{endpoint}: certificates are in order, but no zenoh session came about; try again, and see the car's log"


def _about_the_car(endpoint: str, error: ssl.SSLCertVerificationError) -> str:
    code = error.verify_code
    if code == _EXPIRED:
        return (
            f"{endpoint}: the car's certificate has expired; on the car: sudo wallride keys init --renew (a router's,"
            " where the fleet's keys are: wallride keys router NAME --renew, then copy its folder)"
        )
    if code == _NOT_YET_VALID:
        return f"{endpoint}: the car's certificate is not valid yet; is the clock of this computer right?"
    if code in {_WRONG_NAME, _WRONG_ADDRESS}:
        _, host, _ = split_endpoint(endpoint)
        return (
            f"{endpoint}: the car does not go by the name {host}; use one that `wallride keys list` shows on the car, "
            f"or there: sudo wallride keys init --renew --san {host}"
        )
    return f"{endpoint}: is not the car that your keys are for ({error.verify_message}); choose others with --keys"


def _about_us(endpoint: str, error: ssl.SSLError) -> str:
    for alert, meaning in _ALERTS.items():
        if alert in (error.reason or ""):
            return f"{endpoint}: the car refused us: {meaning}"
    return f"{endpoint}: the car refused us ({error.reason or error}); does a tls endpoint of wallride listen there?"
