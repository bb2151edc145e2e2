"""What `wallride foxglove` understands. Only definitions: the server is imported when it is asked for."""

import argparse
from functools import partial
from typing import TYPE_CHECKING

from wallride import client_options

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]  # noqa: SLF001 - argparse has no public name for it


def add(commands: "Commands") -> None:
    """Add the command."""
    server = commands.add_parser("foxglove", help="a car's topics live in Foxglove, Lichtblick or PlotJuggler")
    server.add_argument("--port", type=int, default=8765, metavar="N", help="where viewers connect (default: 8765)")
    server.add_argument(
        "--host", default="127.0.0.1", metavar="ADDRESS", help="on which address (default: this machine only)"
    )
    client_options.add_common(server)
    server.set_defaults(run=run, say=partial(print, flush=True))


def run(options: argparse.Namespace) -> int:
    """Serve until interrupted; exit code 2 with one line when the user can mend it."""
    from wallride.cli import fail

    try:
        from clients import foxglove_server
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != "foxglove":
            raise
        return fail("this needs one more package: pip install 'wallride[foxglove]'")
    return client_options.run_client(foxglove_server.run, options)
