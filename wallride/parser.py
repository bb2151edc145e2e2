"""Argument parser whose errors suggest the nearest command, choice or option; and options of several commands."""

import argparse
import difflib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Never

CHOICES = re.compile(r"invalid choice: '(?P<wrong>[^']*)' \(choose from (?P<choices>.*)\)", re.DOTALL)
OPTION = re.compile(r"--[a-z][a-z-]+")

DEFAULT_CONFIG = Path("/etc/wallride/car.toml")


class Parser(argparse.ArgumentParser):
    """Return subparsers of this class."""

    def error(self, message: str) -> Never:
        """End with exit code 2 and the nearest known name."""
        found = CHOICES.search(message)
        if found is not None:
            message += did_you_mean(found["wrong"], re.findall(r"[\w-]+", found["choices"]))
        super().error(message)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:  # noqa: ANN401 - as argparse has it
        """Parse; an unknown option that is nearly a known one of this command ends with that."""
        parsed, unknown = super().parse_known_args(args, namespace)
        for text in unknown:
            if text.startswith("--") and (meant := did_you_mean(text.partition("=")[0], self._options())):
                self.error(f"unrecognized arguments: {text}{meant}")
        return parsed, unknown

    def _options(self) -> list[str]:
        return OPTION.findall(self.format_help())


def did_you_mean(wrong: str, known: Sequence[str]) -> str:
    """Return "; did you mean X?" for the nearest known name, "" where none is near."""
    near = difflib.get_close_matches(wrong, known, 1)
    return f"; did you mean {near[0]}?" if near else ""


def add_set(command: argparse.ArgumentParser) -> None:
    """Add --set KEY=VALUE."""
    command.add_argument(
        "--set",
        dest="assignments",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override one setting, for example wall_follow.side=right (repeatable)",
    )


def add_jobs(command: argparse.ArgumentParser) -> None:
    """Add --jobs N."""
    command.add_argument("--jobs", type=int, metavar="N", help="processes (default: one per core)")


def add_json(command: argparse.ArgumentParser, what: str) -> None:
    """Add --json FILE|-."""
    command.add_argument("--json", metavar="FILE|-", help=f"write {what} as JSON")


def default_config() -> Path | None:
    """Return the car's settings file; None where there is none."""
    return DEFAULT_CONFIG if DEFAULT_CONFIG.is_file() else None
