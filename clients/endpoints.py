"""The text of --connect and WALLRIDE_CONNECT: endpoints, and the keys that they need."""

import argparse
import logging
import os
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from wallride.clients import CONNECT_VARIABLE, DEFAULT_KEYS, HIGHEST_PORT
from wallride.runtime.security.access_list import KeysError
from wallride.runtime.security.key_files import KeyFiles, client_keys
from wallride.runtime.wire import zenoh_config

log = logging.getLogger("wallride.client")

PORTS = {"tcp": 7447, "tls": 7448}
"""Ports by protocol; tls has one of its own: `[::]` includes loopback, where tcp listens already."""
ENDPOINT = re.compile(r"(tcp|tls)/(\[[0-9a-fA-F:.]+\]|[\w.-]+):(\d{1,5})")


class ConnectionProblemError(Exception):
    """No connection to the car; the text is one line with the remedy."""


def option_of(options: argparse.Namespace) -> str:
    """Return the option for the endpoints, which a script calls otherwise than a command line."""
    return getattr(options, "connect_option", "--connect")


def given_by(options: argparse.Namespace) -> str:
    """Return what a user has to correct where the options name the endpoints: the variable or the option."""
    return CONNECT_VARIABLE if options.connect == os.environ.get(CONNECT_VARIABLE) else option_of(options)


def endpoint_of(text: str, *, with_keys: bool = False, given: str = "--connect") -> str:
    """Return a zenoh endpoint for a user's text: `car1.local`, `10.0.0.5:7447`, `tls/car1.local:7448`.

    given: the option or variable that has the text, for a ConnectionProblemError.
    """
    scheme, slash, place = text.rpartition("/")
    if not slash:
        scheme = "tls" if with_keys else "tcp"
    if not re.search(r":\d+$", place):
        place = f"{place}:{PORTS.get(scheme, PORTS['tcp'])}"
    endpoint = f"{scheme}/{place}"
    if not ENDPOINT.fullmatch(endpoint):
        raise ConnectionProblemError(
            f"{given} {text}: write tcp/HOST:PORT or tls/HOST:PORT, e.g. tls/car1.local:{PORTS['tls']}"
        )
    if not 1 <= int(place.rpartition(":")[2]) <= HIGHEST_PORT:
        raise ConnectionProblemError(f"{given} {text}: there is no such port; ports are 1 to {HIGHEST_PORT}")
    return endpoint


def endpoint_configs(
    options: argparse.Namespace, unusable: list[str] | None = None
) -> list[tuple[str, dict[str, Any], KeyFiles | None]]:
    """Return the endpoints of --connect, separated by commas, each with the configuration of a session and the keys.

    unusable: where given, takes the reason for an endpoint without one, in place of a ConnectionProblemError: an e-stop
    goes to the others.
    """
    found, given, reasons = [], given_by(options), []
    for text in filter(None, (part.strip() for part in options.connect.split(","))):
        try:
            endpoint = endpoint_of(text, with_keys=options.keys is not None, given=given)
            keys = keys_of(endpoint, options.keys)
            found.append((endpoint, session_config(endpoint, keys), keys))
        except ConnectionProblemError as error:
            if unusable is None:
                raise
            reasons.append(str(error))
    if unusable is not None:
        unusable += reasons
    if not found and not reasons:
        raise ConnectionProblemError(f"{given}: name at least one endpoint, e.g. tcp/127.0.0.1:7447")
    return found


def session_config(endpoint: str, keys: KeyFiles | None) -> dict[str, Any]:
    """Return the configuration of a session at an endpoint; ConnectionProblemError where zenoh can have none."""
    try:
        return zenoh_config.client_config(endpoint, keys.tls if keys is not None else None)
    except ValueError as error:
        raise ConnectionProblemError(str(error)) from None


def keys_of(endpoint: str, folder: Path | None) -> KeyFiles | None:
    """Return the checked keys for an endpoint, None for tcp/, which has none; ConnectionProblemError when unusable."""
    if not endpoint.startswith("tls/"):
        return None
    try:
        keys = client_keys((folder or Path(DEFAULT_KEYS)).expanduser(), datetime.now(UTC))
    except KeysError as error:
        raise ConnectionProblemError(f"{endpoint} needs keys: {error}") from None
    for warning in keys.warnings:
        log.warning("%s", warning)
    return keys
