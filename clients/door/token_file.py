"""Token in the page's address, kept until its user logs out or the machine restarts.

A page that is open on a phone thereby finds the server again after the server's restart. It lies where only its user
can read it ($XDG_RUNTIME_DIR, cleared by the system); without such a place every start has a secret of its own.
"""

import os
import re
import secrets
import stat
from collections.abc import Mapping
from pathlib import Path

BYTES = 12
_WORD = re.compile(r"[A-Za-z0-9_-]{16}")


def login_token(command: str = "monitor", environment: Mapping[str, str] = os.environ) -> str:
    """Return the token of this login for a command's server, made at its first use."""
    fresh = secrets.token_urlsafe(BYTES)
    folder = environment.get("XDG_RUNTIME_DIR")
    if not folder:
        return fresh
    path = Path(folder) / file_name(command)
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    except FileExistsError:
        return _read(path) or fresh
    except OSError:  # a place that cannot be written to keeps nothing
        return fresh
    with os.fdopen(descriptor, "w") as file:
        file.write(fresh)
    return fresh


def file_name(command: str) -> str:
    """Return the name of the file; each server has a token of its own, because they may do different things."""
    return f"wallride-{command}-secret"


def _read(path: Path) -> str:
    """Return the kept token, "" unless it is valid and readable only by its user."""
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)) as file:
            about = os.fstat(file.fileno())
            private = stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and not about.st_mode & 0o077
            text = file.read(64) if private else ""
    except OSError:
        return ""
    return text if _WORD.fullmatch(text) else ""
