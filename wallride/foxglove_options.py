"""Options of `wallride foxglove`. The server is imported when the command runs."""

import argparse
import sys
from pathlib import Path

from wallride import client_options
from wallride.failure import fail, needs
from wallride.parser import Commands
from wallride.runtime.host.terminal_text import say

LAYOUT = "foxglove-layout.json"


def add(commands: Commands) -> None:
    """Add the command."""
    server = commands.add_parser("foxglove", help="a car's topics live in Foxglove, Lichtblick or PlotJuggler")
    server.add_argument(
        "--port", type=client_options.port, default=8765, metavar="N", help="port of the server (default: 8765)"
    )
    server.add_argument(
        "--host", default="127.0.0.1", metavar="ADDRESS", help="address of the server (default: this machine only)"
    )
    server.add_argument(
        "--page", dest="pages", action="append", default=[], metavar="ORIGIN",
        help="web page that may connect beside Foxglove's own, such as a Lichtblick of yours: http://localhost:8080"
        " (repeatable)",
    )  # fmt: skip
    server.add_argument(
        "--layout", action="store_true", help="print a layout for Foxglove and exit: --layout > wallride.json"
    )
    client_options.add_common(server)
    server.set_defaults(run=run, print_line=say)


def run(options: argparse.Namespace) -> int:
    """Serve until interrupted; exit code 2 with one line for an error that the user can correct."""
    if options.layout:
        return _print_layout()
    with needs("foxglove", "foxglove needs"):
        from wallride.clients.foxglove import server
    return client_options.run_client(server.run, options)


def _print_layout() -> int:
    """Print the layout of this checkout, or of the installed package."""
    places = [Path(__file__).parents[1] / "docs" / LAYOUT, Path(sys.prefix) / "share" / "wallride" / LAYOUT]
    for place in places:
        if place.is_file():
            sys.stdout.write(place.read_text(encoding="utf-8"))
            return 0
    return fail(f"{LAYOUT} is not installed (looked for {places[-1]})")
