"""Text for a terminal or a log, wherever it comes from: a car, a file, another operator.

An escape sequence in a name would clear the screen or colour it, a newline would forge a line, a mark of direction
would turn words around. Every command prints by `say`, and text of others is one line of it by `one_line`.
"""

import sys
from collections.abc import Callable, Sequence
from typing import Final, TextIO, TypeVar

LONGEST: Final = 2000
USAGE_ERROR: Final = 2
"""Exit code of a command that the user can correct."""
CLEAR_SCREEN: Final = "\x1b[H\x1b[2J"
Answer = TypeVar("Answer")
YES, NO = frozenset({"y", "yes"}), frozenset({"n", "no"})
CHOICES = {True: "[Y/n]", False: "[y/N]", None: "[y/n]"}


def one_line(text: object, most: int = LONGEST) -> str:
    """Return a text as one printable line of at most this many characters, the others as escapes."""
    words = str(text)
    line = _escaped(words[: most + 1])
    return line if len(line) <= most else f"{line[: most - 3]}..."


def in_columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines; every column but the last is as wide as its widest cell."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
    padded = ([*map(str.ljust, row, widths), row[-1]] for row in rows)
    return ["  ".join(cells).rstrip() for cells in padded]


def say(text: str = "", *, file: TextIO | None = None, end: str = "\n") -> None:
    """Print a text, also of several lines; only a screen of ours begins with CLEAR_SCREEN."""
    body = text.removeprefix(CLEAR_SCREEN)
    head = text[: len(text) - len(body)]
    lines = "\n".join(map(_escaped, body.split("\n")))
    print(head + lines, file=file or sys.stdout, end=end, flush=True)


def complain(words: object, code: int = USAGE_ERROR) -> int:
    """Say on standard error what is wrong, and return the exit code."""
    say(f"wallride: {words}", file=sys.stderr)
    return code


def _escaped(text: str) -> str:
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


def yes_or_no(question: str, *, default: bool | None = None) -> bool | None:
    """Return the answer. default: of Enter and of a closed terminal; None: Enter is asked again."""

    def read(text: str) -> bool | None:
        word = text.lower()
        if word not in YES | NO:
            raise ValueError("type y or n")
        return word in YES

    return asked(f"{question} {CHOICES[default]} ", read, default, needed=default is None)


def asked(question: str, read: Callable[[str], Answer], default: Answer, *, needed: bool = False) -> Answer:
    """Return what `read` makes of the typed text; it raises ValueError with the remedy, and the question comes again.

    default: of Enter, unless an answer is needed, and of a closed terminal.
    """
    while True:
        try:
            text = input(question).strip()
        except EOFError:
            say()  # the cursor is behind the question
            return default
        if not text and not needed:
            return default
        try:
            return read(text)
        except ValueError as error:
            say(f"  {error}")
