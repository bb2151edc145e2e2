"""What `wallride topic`, `wallride cars` and `wallride status` understand; only definitions."""

import argparse
from functools import partial
from typing import TYPE_CHECKING

from wallride import client_options

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]  # noqa: SLF001 - argparse has no public name for it

say = partial(print, flush=True)


def add(commands: "Commands") -> None:
    """Add the three commands."""
    topic = commands.add_parser("topic", help="what a car says: list, hz, bw, echo")
    actions = topic.add_subparsers(dest="action", required=True, metavar="ACTION")
    listing = actions.add_parser("list", help="all topics with type, rate and volume")
    listing.add_argument("--seconds", type=float, default=1.5, metavar="S", help="how long to listen (default: 1.5)")
    listing.add_argument("--json", action="store_true", help="as JSON, for programs")
    rate = actions.add_parser("hz", help="how often, and how regularly, a topic comes")
    volume = actions.add_parser("bw", help="how much of the network a topic takes")
    echo = actions.add_parser("echo", help="what a topic says")
    for action in (rate, volume, echo):
        action.add_argument("topic", metavar="TOPIC", help="scan, /scan or wallride/car1/scan")
        action.add_argument("-n", "--count", type=int, default=0, metavar="N", help="stop after N (default: never)")
    for action in (rate, volume):
        action.add_argument("--json", action="store_true", help="one line of JSON a second, for programs")
    echo.add_argument("--once", dest="count", action="store_const", const=1, help="the same as -n 1")
    echo.add_argument("--json", action="store_true", help="one line of JSON each, for programs")
    echo.add_argument("--whole", action="store_true", help="do not shorten arrays")
    for action in (listing, rate, volume, echo):
        client_options.add_common(action)
        action.set_defaults(run=_topic, say=say)
    _add_status(commands)


def _add_status(commands: "Commands") -> None:
    cars = commands.add_parser("cars", help="which cars are there, with version and state")
    status = commands.add_parser("status", help="one screen: why is it (not) moving?")
    status.add_argument("--watch", action="store_true", help="keep it up to date until Ctrl-C")
    for command in (cars, status):
        client_options.add_common(command)
        command.add_argument("--json", action="store_true", help="as JSON, for programs")
    cars.set_defaults(run=_cars, say=say)
    status.set_defaults(run=_status, say=say)


def _topic(options: argparse.Namespace) -> int:
    from clients import topics

    return client_options.run_client(topics.run, options)


def _cars(options: argparse.Namespace) -> int:
    from clients import status

    return client_options.run_client(status.cars, options)


def _status(options: argparse.Namespace) -> int:
    from clients import status

    return client_options.run_client(status.run, options)
