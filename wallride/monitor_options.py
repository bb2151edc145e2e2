"""Options of `wallride monitor`. The server is imported when the command runs."""

import argparse
from pathlib import Path

from wallride.client_options import add_common, add_name, port, run_client
from wallride.failure import needs
from wallride.parser import CONFIG_VARIABLE, Commands, add_config, named_config, number
from wallride.runtime.host.terminal_text import say

DEFAULT_PORT = 8447


def add(commands: Commands) -> None:
    """Add the command and its options."""
    parser = commands.add_parser(
        "monitor",
        help="the car in a browser: scan, decisions, settings, driving",
        description="Serves one page and opens it; works offline."
        " Several cars: --connect tls/car1.local,tls/car2.local",
    )
    add_common(parser)
    parser.add_argument(
        "--port",
        type=port,
        metavar="N",
        help=f"port, 0 for any free one (default: {DEFAULT_PORT}, or a free one if that is in use)",
    )
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="address to serve (default: 127.0.0.1, this machine only), for example 0.0.0.0 for a phone; the page's"
        " address carries a secret token",
    )
    parser.add_argument("--no-browser", dest="browser", action="store_false", help="only print the page's address")
    parser.add_argument(
        "--max-speed", type=number(0.1, 20.0), default=1.5, metavar="MPS",
        help="maximum speed of driving from the page (default: 1.5)",
    )  # fmt: skip
    parser.add_argument(
        "--max-steering", type=number(0.05, 1.5), default=0.34, metavar="RAD",
        help="maximum steering angle from the page (default: 0.34)",
    )  # fmt: skip
    add_config(
        parser,
        "settings file, on the car's computer: calibrated values, and a map to race on, that a page accepts go there",
        f"${CONFIG_VARIABLE}; without a file pages show them",
    )
    parser.add_argument(
        "--farewell", type=Path, metavar="FILE",
        help="file with the sentence that open pages show once the server has ended, read at its end",
    )  # fmt: skip
    add_name(parser)
    parser.set_defaults(run=run, print_line=say, default_port=DEFAULT_PORT)


def run(options: argparse.Namespace) -> int:
    """Run the server; exit code 2 when a package is missing."""
    with needs("monitor", "the monitor needs"):
        from wallride.clients.monitor import server
    options.config = options.config or named_config()
    return run_client(server.run, options)
