"""Text of a file that a user names: a device may have no end, a pipe no writer, and an editor marks the beginning."""

from pathlib import Path
from typing import Final

MB: Final = 1_000_000
STREAMS: Final = ("/", "dev")
"""Where pipes are that have a writer: /dev/stdin, and /dev/fd/63 of a shell's <(COMMAND)."""


class TextFileError(ValueError):
    """A file that holds no text of a bearable length; the text says what it is."""


def read_text(path: Path, most_mb: int = 1, errors: str = "strict") -> str:
    """Return the UTF-8 text of a file, without a byte order mark. errors: what becomes of other bytes, as of `decode`.

    Raises: TextFileError for a pipe, for more than `most_mb`, for other bytes; OSError when it cannot be read.
    """
    if path.is_fifo() and path.parts[:2] != STREAMS:
        raise TextFileError("it is a pipe")
    with path.open("rb") as file:
        content = file.read(most_mb * MB + 1)
    if len(content) > most_mb * MB:
        raise TextFileError(f"it is longer than {most_mb} MB")
    try:
        return content.decode("utf-8-sig", errors)
    except UnicodeDecodeError:
        raise TextFileError("it is not text in UTF-8") from None
