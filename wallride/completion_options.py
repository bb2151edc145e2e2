"""Options of `wallride completion`: a script for a shell, generated from the parser of all commands."""

import argparse
import sys
from collections.abc import Callable

from wallride.failure import needs
from wallride.parser import Commands

SHELLS = ("bash", "zsh", "fish")
INSTALL = {
    "bash": "wallride completion bash > ~/.local/share/bash-completion/completions/wallride",
    "zsh": "wallride completion zsh > a folder of $fpath, as _wallride",
    "fish": "wallride completion fish > ~/.config/fish/completions/wallride.fish",
}


def add(commands: Commands, whole: Callable[[], argparse.ArgumentParser]) -> None:
    """Add the command. whole: builds the parser of all commands."""
    completion = commands.add_parser(
        "completion",
        help="completion of commands and options for a shell",
        description="Prints a script. Install it: " + "; ".join(INSTALL.values()),
    )
    completion.add_argument("shell", choices=SHELLS)
    completion.set_defaults(run=run, whole=whole)


def run(options: argparse.Namespace) -> int:
    """Print the script; exit code 2 with one line where the package is missing."""
    with needs("clients", "completion needs"):
        import shtab
    sys.stdout.write(shtab.complete(options.whole(), options.shell) + "\n")
    return 0
