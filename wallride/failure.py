"""Errors that the user can correct: one sentence on stderr and exit code 2."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from runtime.host.terminal_text import one_line, say

USAGE_ERROR = 2
OWN_PACKAGES = frozenset({"clients", "drivers", "runtime", "sim", "wallride"})


def fail(message: str) -> int:
    """Print the error in one line and return its exit code."""
    say(f"wallride: {one_line(message)}", file=sys.stderr)
    return USAGE_ERROR


@contextmanager
def needs(extra: str, subject: str) -> Iterator[None]:
    """Turn a missing package into a sentence and SystemExit; a missing module of our own stays a bug.

    extra: of the installation, that has it. subject: with its verb, "recordings need".
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] in OWN_PACKAGES:
            raise
        message = f"{subject} {error.name}: install it with  pip install 'wallride[{extra}]'"
        raise SystemExit(fail(message)) from None
