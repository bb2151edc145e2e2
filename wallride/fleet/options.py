"""Options of `wallride router`, `wallride stop` and `wallride race`."""

import argparse
from pathlib import Path
from typing import Final

from wallride import client_options
from wallride.failure import fail
from wallride.parser import Commands
from wallride.runtime.host.terminal_text import say

BENCH_ROUTER: Final = "tcp/127.0.0.1:7449"


def add(commands: Commands) -> None:
    """Add the commands."""
    router = commands.add_parser(
        "router",
        help="a router between cars and viewers",
        description="Runs a router of zenoh until Ctrl-C. Its file comes from `wallride keys router`; without a file it"
        " serves this computer only, without keys.",
    )
    router.add_argument("file", nargs="?", type=Path, help="configuration from `wallride keys router NAME`")
    router.add_argument(
        "--listen", default=BENCH_ROUTER, metavar="ENDPOINT", help=f"without a file: where (default: {BENCH_ROUTER})"
    )
    router.set_defaults(run=client_options.client("fleet.router"), print_line=say)
    stop = commands.add_parser(
        "stop",
        help="e-stop to one car or to all",
        description="Sends the e-stop by every endpoint until each car confirms it; exit code 1 when one does not."
        " Each car is reset by its own operator afterwards.",
    )
    client_options.add_common(stop)
    stop.add_argument("--all", action="store_true", help="stop every car at every endpoint: --connect A,B")
    client_options.add_name(stop)
    stop.set_defaults(run=client_options.client("fleet.stop"), print_line=say)
    race = commands.add_parser(
        "race",
        help="laps, gaps and positions of several cars",
        description="Counts each car's laps from its own odometry until Ctrl-C: n begins a new race, Space stops every"
        " car. Without --line a car's line is where it stands when it is first heard.",
    )
    race.add_argument("map", nargs="*", help=argparse.SUPPRESS)  # one word may well mean a race on a map
    client_options.add_common(race)
    client_options.add_name(race)
    race.add_argument(
        "--line", action="append", metavar="[CAR=]X1,Y1,X2,Y2",
        help="left and right end of the line, seen by a car that crosses it, in metres of the car's odometry, which"
        " begins where its program started; may be repeated, for cars that started at different places",
    )  # fmt: skip
    race.add_argument(
        "--order", choices=("laps", "best"), default="laps", help="positions by laps and time, or by the best lap"
    )
    race.add_argument("--json", action="store_true", help="print JSON, a line per second")
    race.set_defaults(run=_race, print_line=say)


def _race(options: argparse.Namespace) -> int:
    if options.map:
        return fail(
            f"wallride race times real and simulated cars; a race on a map: wallride sim --race {options.map[0]}"
        )
    return client_options.client("fleet.race_command")(options)
