"""Files that a command writes: whole or not at all. A full disk or Ctrl-C leaves nothing that looks like one."""

import os
import stat
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Final

Content = str | bytes | Callable[[IO[bytes]], object]
"""What a file is to hold; a function writes it."""
OF_THE_SYSTEM: Final = (Path("/dev"), Path("/proc"))
"""What lies there stands for something else, such as this command's own output: nothing is put in its place."""


def write_file(path: Path, content: Content) -> None:
    """Write one file, as `write_files`."""
    write_files({path: content})


def write_files(contents: Mapping[Path, Content]) -> None:
    """Write files beside their places, then rename all of them; OSError names the file, and nothing is left.

    Where no other file can take the place (a device, a pipe, a folder that takes no new one) it is written as it is.
    """
    written: dict[Path, Path] = {}
    at = Path()
    try:
        for path, content in contents.items():
            at = path
            if _stays(path):
                _write(path, content, os.O_TRUNC)
                continue
            place = Path(os.path.realpath(path))  # a link to the file stays a link
            part = place.with_name(f".{place.name}.{os.getpid()}")
            written[part] = place
            _write(part, content, os.O_EXCL, place)
        for part, place in written.items():
            at = place
            part.replace(place)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(at)) from None
    finally:
        for part in written:
            with suppress(OSError):  # renamed, or on a disk that went away
                part.unlink()


def write_answer(text: str, target: str | None) -> None:
    """Write what `--json FILE|-` asks for: "-" is standard output, None nowhere."""
    if target == "-":
        sys.stdout.write(text)
    elif target is not None:
        write_file(Path(target), text)


def _stays(path: Path) -> bool:
    where = path.absolute()
    if any(folder in where.parents for folder in OF_THE_SYSTEM):
        return True
    may_be_replaced = path.is_file() and os.access(path, os.W_OK) and os.access(where.resolve().parent, os.W_OK)
    return path.exists() and not may_be_replaced


def _write(path: Path, content: Content, how: int, like: Path | None = None) -> None:
    """Write one file. how: flags of its opening. like: the file whose rights it gets, where there is one."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | how, 0o666)
    with os.fdopen(descriptor, "wb") as file:
        if like is not None and like.exists():
            os.fchmod(descriptor, stat.S_IMODE(like.stat().st_mode))
        if callable(content):
            content(file)
        else:
            file.write(content.encode(errors="backslashreplace") if isinstance(content, str) else content)
