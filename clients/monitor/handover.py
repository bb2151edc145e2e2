"""The page's address for the browser, in a file that only this user can read.

An address on a command line, as every opener of browsers has it, is shown to all users of a computer (ps). The file
leads on to the address by itself, and is deleted when the monitor ends.
"""

import html
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

PAGE = """<!doctype html><meta charset="utf-8"><meta name="referrer" content="no-referrer"><title>wallride</title>
<meta http-equiv="refresh" content="0; url={address}"><p><a href="{address}">to the car</a></p>
"""


@contextmanager
def handed_over(url: str, environment: Mapping[str, str] = os.environ) -> Iterator[str]:
    """Yield the file's address while the block runs. Its folder is this login's own, or a new one of mode 700."""
    place = environment.get("XDG_RUNTIME_DIR") or None
    with tempfile.TemporaryDirectory(prefix="wallride-monitor-", dir=place, ignore_cleanup_errors=True) as folder:
        file = Path(folder) / "page.html"
        with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600), "w") as out:
            out.write(PAGE.format(address=html.escape(url)))
        yield file.as_uri()
