"""The last place for an exception that a command did not expect: a sentence for the user, the details in a file."""

import os
import sys
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from runtime.host.terminal_text import one_line, say

FAILED: Final = 1
TRACEBACK_VARIABLE: Final = "WALLRIDE_TRACEBACK"
"""Environment variable: with any value, an unexpected exception is shown whole."""
NAME: Final = "last-error.txt"


def report(error: Exception, command: str, environment: Mapping[str, str] = os.environ) -> int:
    """Say that a command failed, and keep the details for whoever mends it; returns the exit code."""
    details = "".join(traceback.format_exception(error))
    try:
        place = _keep(f"wallride {command}, Python {sys.version.split()[0]}\n{details}", environment)
    except OSError:
        say(details, file=sys.stderr)
        place = "above"
    what = one_line(f"{type(error).__name__}: {error}", 300)
    say(
        f"wallride: {command} failed in a way that it did not expect ({what}). The details are {place};"
        " please send them to who looks after wallride",
        file=sys.stderr,
    )
    return FAILED


def _keep(details: str, environment: Mapping[str, str]) -> str:
    base = environment.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    path = Path(base) / "wallride" / NAME
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(details, encoding="utf-8", errors="backslashreplace")
    return f"in {path}"
