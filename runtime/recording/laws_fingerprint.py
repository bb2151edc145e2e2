"""Fingerprint of the laws: of everything that turns scans into motor commands, kept in each recording.

A version identifies a release; between two releases, and in a student's checkout, the laws change without it.
"""

import functools
import hashlib
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
PLACES = ("arbitration", "control", "kernel")
ENDINGS = {".py", ".c", ".h"}
DIGITS = 12


@functools.cache
def laws_fingerprint(*own: Path) -> str:
    """Return a hash that changes with every change of a law, of its compiled twin, or of the mux's rule.

    own: files of the user's laws. Reads the files once.
    """
    digest = hashlib.sha256()
    for path in law_files(PACKAGE):
        digest.update(path.relative_to(PACKAGE).as_posix().encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    for path in own:
        digest.update(path.read_bytes() if path.is_file() else b"")
    return digest.hexdigest()[:DIGITS]


def law_files(package: Path) -> Iterator[Path]:
    """Yield the source files of the laws, in an order that does not depend on the machine."""
    for place in PLACES:
        yield from sorted(path for path in (package / place).rglob("*") if path.suffix in ENDINGS)
