"""Argument parser with grouped commands, whose errors suggest the nearest name; and options of several commands."""

import argparse
import difflib
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Never, TypeAlias

from wallride.failure import fail_at_place, forget_output
from wallride.runtime.host.terminal_text import USAGE_ERROR, one_line, say

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"  # noqa: SLF001 - there is no public name
"""Where a command is added to the others."""
CHOICES = re.compile(r"invalid choice: '(?P<wrong>[^']*)' \(choose from (?P<choices>.*)\)", re.DOTALL)
OPTION = re.compile(r"--[a-z][a-z-]+")

DEFAULT_CONFIG = Path("/etc/wallride/car.toml")
CONFIG_VARIABLE = "WALLRIDE_CONFIG"
"""Environment variable: the car's settings file for every command that reads one, unless it is named."""


GROUPS: Final[Mapping[str, Sequence[str]]] = {
    "first drive": ("sim", "emulate", "import", "check", "doctor", "vesc", "calibrate", "service", "deploy"),
    "daily": (
        "run", "teleop", "monitor", "status", "stop", "param", "logs", "record", "replay", "report", "plot", "topic",
        "foxglove", "own-parts", "completion",
    ),
    "own laws and lab": ("new", "lab", "map", "pose", "line", "bench", "build-kernel"),
    "fleet, and access over the network": ("cars", "race", "router", "keys"),
}  # fmt: skip
"""By title, the commands in the order of the help; one that stands in no group is shown in a last one."""
OTHERS: Final = "others"
NEAR: Final = 0.7
"""Similarity from which a name is suggested: of --laps and --help it is 0.67."""


class Parser(argparse.ArgumentParser):
    """Return subparsers of this class."""

    def error(self, message: str) -> Never:
        """End with exit code 2 and one line: what is wrong, the nearest known name, where the rest is written."""
        found = CHOICES.search(message)
        if found is not None:
            message += did_you_mean(found["wrong"], re.findall(r"[\w-]+", found["choices"]))
        say(f"{self.prog}: {one_line(' '.join(message.split()))} ({self.prog} --help has all options)", file=sys.stderr)
        raise SystemExit(USAGE_ERROR)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:  # noqa: ANN401 - as argparse has it
        """Parse; an unknown option ends with the nearest known one of this command, which names itself.

        Options in the place of an action are of the default action, where this command has one.
        """
        action = self.get_default("action") if self._subparsers is not None else None
        if action is not None and args and args[0].startswith("-") and args[0] not in {"-h", "--help"}:
            args = [action, *args]
        parsed, unknown = super().parse_known_args(args, namespace)
        for text in unknown:
            if text.startswith("--"):
                self.error(f"unrecognized arguments: {text}{did_you_mean(text.partition('=')[0], self._options())}")
        return parsed, unknown

    def _print_message(self, message: str, file: Any = None) -> None:  # noqa: ANN401 - as argparse has it
        """Write, as argparse does for --help and --version, but tell of an output that cannot be written."""
        out = sys.stderr if file is None else file
        try:
            out.write(message)
            out.flush()
        except BrokenPipeError:  # the reader has seen enough
            forget_output()
            raise SystemExit(0) from None
        except OSError as error:
            raise SystemExit(fail_at_place(error) or USAGE_ERROR) from None

    def _options(self) -> list[str]:
        return OPTION.findall(self.format_help())


class GroupedParser(Parser):
    """The parser of all commands: its help shows them in groups."""

    def format_help(self) -> str:
        """Return the help: usage, the groups, the options."""
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        for title, commands in self._grouped():
            formatter.start_section(title)
            formatter.add_arguments(commands)
            formatter.end_section()
        formatter.start_section("options")
        formatter.add_arguments([action for action in self._actions if action.option_strings])
        formatter.end_section()
        formatter.add_text(f"{self.prog} COMMAND --help has the options of a command.")
        return formatter.format_help()

    def _grouped(self) -> Iterator[tuple[str, list[argparse.Action]]]:
        """Yield each group's title and its commands, as argparse has them."""
        waiting = {
            shown.dest: shown
            for action in self._actions
            if isinstance(action, argparse._SubParsersAction)  # noqa: SLF001 - argparse has no public name for it
            for shown in action._choices_actions  # noqa: SLF001 - nor for this
        }
        for title, names in GROUPS.items():
            yield title, [waiting.pop(name) for name in names if name in waiting]
        if waiting:
            yield OTHERS, list(waiting.values())


def did_you_mean(wrong: str, known: Sequence[str]) -> str:
    """Return "; did you mean X?" for the nearest known name, "" where none is near."""
    near = difflib.get_close_matches(wrong, known, 1, NEAR)
    return f"; did you mean {near[0]}?" if near else ""


class _OneFile(argparse.Action):
    """Take a file that may be given in two ways, but not two files."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, _option: str | None = None
    ) -> None:
        if values is None:  # FILE is not given: --config may be
            return
        before = getattr(namespace, self.dest, None)
        if before not in {None, values}:
            parser.error(f"two settings files: {before} and {values}; name one")
        setattr(namespace, self.dest, values)


def add_config(
    command: argparse.ArgumentParser, use: str = "settings file of the car",
    default: str = f"${CONFIG_VARIABLE}, else {DEFAULT_CONFIG} if there", *, positional: bool = True,
) -> None:  # fmt: skip
    """Add the settings file, as --config FILE. use: what it is for. default: where none is named.

    positional: as FILE as well, where the command has no other argument that an option may part from it.
    """
    words = f"{use} (default: {default})"
    if positional:
        command.add_argument("config", nargs="?", type=Path, action=_OneFile, metavar="FILE", help=words)
    command.add_argument(
        "--config", type=Path, action=_OneFile, metavar="FILE", help="the same" if positional else words
    )


def add_set(
    command: argparse.ArgumentParser, what: str = "override one setting, for example wall_follow.side=right"
) -> None:
    """Add --set KEY=VALUE."""
    command.add_argument(
        "--set", dest="assignments", action="append", default=[], metavar="KEY=VALUE", help=f"{what} (repeatable)"
    )


def at_least(lowest: int) -> Callable[[str], int]:
    """Return a converter of an option's text to a whole number that is not below this one."""

    def whole(text: str) -> int:
        number = int(text)
        if number < lowest:
            raise argparse.ArgumentTypeError(f"at least {lowest}")
        return number

    whole.__name__ = "whole number"  # argparse names it where the text is none
    return whole


def number(lowest: float, highest: float, what: str = "a number") -> Callable[[str], float]:
    """Return a converter of an option's text to a number between two others; NaN is not."""

    def converted(text: str) -> float:
        value = float(text)
        if not lowest <= value <= highest:
            raise argparse.ArgumentTypeError(f"write {what} from {lowest:g} to {highest:g}")
        return value

    converted.__name__ = "number"  # argparse names it where the text is none
    return converted


def add_jobs(command: argparse.ArgumentParser) -> None:
    """Add --jobs N."""
    command.add_argument("--jobs", type=at_least(1), metavar="N", help="processes (default: one per core)")


LINE: Final = ".line.csv"
KEPT: Final = (".mcap", ".bag", ".db3", ".npz", ".yaml", ".yml", ".pgm", ".walls.csv", ".path.csv")
"""Endings of recordings and maps, which another file is not put in place of: a recording cannot be made again."""


def add_json(command: argparse.ArgumentParser, what: str) -> None:
    """Add --json FILE|-."""
    command.add_argument("--json", type=_writable_json, metavar="FILE|-", help=f"write {what} as JSON")


def _writable_json(text: str) -> str:
    return writable(text, (*KEPT, LINE, ".toml"))


def writable(text: str, kept: tuple[str, ...] = (*KEPT, LINE)) -> str:
    """Return the name of a file to write, "-" as it is; checked before minutes of work, not after them."""
    path = Path(text)
    if text == "-":
        return text
    if text.lower().endswith(kept):
        raise argparse.ArgumentTypeError(f"{text} is the name of a recording or of a map's part; name another file")
    try:
        is_folder, is_of_map = path.is_dir(), bool(kept) and _is_of_map(path)
    except OSError as error:
        raise argparse.ArgumentTypeError(f"{text[:40]}...: {error.strerror}; name another file") from None
    if is_of_map:
        raise argparse.ArgumentTypeError(f"{text} is a picture of the map beside it; name another file")
    if is_folder:
        raise argparse.ArgumentTypeError(f"{text} is a directory; name a file in it")
    if not path.absolute().parent.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: there is no directory {path.parent}; make it first")
    if not os.access(path if path.exists() else path.absolute().parent, os.W_OK):
        raise argparse.ArgumentTypeError(f"{text} may not be written by you; name another place")
    return text


def _is_of_map(path: Path) -> bool:
    """Whether a picture is that of a map, or its very image."""
    is_picture = path.suffix.lower() in {".png", ".jpg", ".jpeg", ".bmp"}
    return is_picture and any(path.with_suffix(ending).exists() for ending in (".yaml", ".yml"))


def writable_path(text: str, kept: tuple[str, ...] = (*KEPT, LINE)) -> Path:
    """Return the same as a path; "-" is none."""
    if text == "-":
        raise argparse.ArgumentTypeError("- is no file; name one")
    return Path(writable(text, kept))


def writable_map(text: str) -> Path:
    """Return the path of a map to write, with others beside it: no device, whose folder has no place for them."""
    path = writable_path(text, ())
    if path.exists() and not path.is_file():
        raise argparse.ArgumentTypeError(f"{text} is a device, and other files go beside it; name another place")
    return path


def writable_files(text: str) -> Path:
    """Return the path of a file to write with a picture beside it, which is not that of a map."""
    path = writable_map(text)
    writable(text, KEPT)
    if _is_of_map(picture := path.with_suffix(".png")):
        raise argparse.ArgumentTypeError(f"{text} comes with {picture}, which is a map's picture; name another file")
    return path


def writable_poses(text: str) -> Path:
    """Return the same for poses, which are no race line either."""
    writable(text)
    return writable_files(text)


def default_config() -> Path | None:
    """Return the car's settings file where none is named; None where there is none."""
    return named_config() or (DEFAULT_CONFIG if DEFAULT_CONFIG.is_file() else None)


def named_config(environment: Mapping[str, str] = os.environ) -> Path | None:
    """Return the settings file that the environment names; None where it names none."""
    named = environment.get(CONFIG_VARIABLE)
    return Path(named).expanduser() if named else None
