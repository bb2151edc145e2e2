"""Options and exit codes of the commands that talk to a car over zenoh."""

import argparse
import os
import socket
from collections.abc import Callable, Coroutine
from importlib import import_module
from pathlib import Path
from typing import Any

from wallride.clients import CONNECT_VARIABLE, DEFAULT_CONNECT, DEFAULT_KEYS, HIGHEST_PORT
from wallride.failure import fail
from wallride.runtime.host.ownership import user_name


def add_common(parser: argparse.ArgumentParser) -> None:
    """Add --car, --session, --connect and --keys; `wallride.clients.connection` reads them."""
    parser.add_argument("--car", metavar="NAME", help="name of the car (default: the only one found)")
    parser.add_argument(
        "--session", type=_session, metavar="ID",
        help="session of the car, as its log and `wallride sim` print it (default: any)",
    )  # fmt: skip
    parser.add_argument(
        "--connect",
        metavar="ENDPOINT",
        default=os.environ.get(CONNECT_VARIABLE) or DEFAULT_CONNECT,
        help="endpoint of the car, or several with commas, which are searched for it, e.g. tls/car1.local:7448"
        f" (default: ${CONNECT_VARIABLE}, else {DEFAULT_CONNECT})",
    )
    parser.add_argument(
        "--keys",
        type=Path,
        metavar="DIR",
        help=f"folder of your keys, for tls/ endpoints (default: {DEFAULT_KEYS} if it exists)",
    )


def add_name(parser: argparse.ArgumentParser) -> None:
    """Add --name, of the operator; by default the user and the computer."""
    parser.add_argument(
        "--name",
        default=f"{user_name('operator')}@{socket.gethostname().split('.')[0]}",
        help="name shown on the car and to other operators (default: you@this-computer)",
    )


def client(module: str, function: str = "run") -> Callable[[argparse.Namespace], int]:
    """Return what runs a coroutine of `wallride.clients`, by the names of its module and itself; imported then."""

    def run(options: argparse.Namespace) -> int:
        return run_client(getattr(import_module(f"wallride.clients.{module}"), function), options)

    return run


def run_client(program: Callable[[argparse.Namespace], Coroutine[Any, Any, int]], options: argparse.Namespace) -> int:
    """Run a client's coroutine; an error that the user can correct becomes one line and exit code 2."""
    from wallride.clients.connection import ConnectionProblemError
    from wallride.clients.ending import run_to_end

    try:
        return run_to_end(program(options))
    except ConnectionProblemError as problem:
        return fail(str(problem))


def port(text: str) -> int:
    """Return a port for an option; 0 is any free one."""
    if not text.isdecimal() or int(text) > HIGHEST_PORT:
        raise argparse.ArgumentTypeError(f"{text} is not a port: 0 to {HIGHEST_PORT}")
    return int(text)


def _session(text: str) -> int:
    try:
        return int(text, 16)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text} is not a session: eight hexadecimal digits") from None
