"""Questions to the person at the terminal: what is no answer is asked again, and taken for none."""

from collections.abc import Callable
from typing import TypeVar

from wallride.runtime.host.terminal_text import say

Answer = TypeVar("Answer")
YES, NO = frozenset({"y", "yes"}), frozenset({"n", "no"})
CHOICES = {True: "[Y/n]", False: "[y/N]", None: "[y/n]"}


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
