"""Low descriptor numbers reserved for the devices, so that a flood of connections cannot take them.

`select()` watches descriptors below 1024 only, and a process has a limited number of them. Each connection of an
unknown client takes the lowest free number; 1100 of them left none for a lidar that reconnects. So some low numbers
point to /dev/null from the start; opening a device frees them for as long as it takes, and closing one fills them up.
"""

import contextlib
import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

MAX_WATCHED: Final = 1024
"""FD_SETSIZE: `select()` takes no descriptor from here on (select(2))."""
SPARES: Final = 8

_spares: list[int] = []


def refill() -> None:
    """Hold SPARES low descriptors, or as many as are free; idempotent."""
    with contextlib.suppress(OSError):  # none left: the next close fills up
        while len(_spares) < SPARES:
            spare = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)
            if spare >= MAX_WATCHED:
                os.close(spare)
                return
            _spares.append(spare)


@contextmanager
def freed() -> Iterator[None]:
    """Free the spare numbers while a device is opened."""
    while _spares:
        os.close(_spares.pop())
    try:
        yield
    finally:
        refill()


def check(descriptor: int) -> int:
    """Return the descriptor; OSError EMFILE where `select()` cannot watch it."""
    if descriptor >= MAX_WATCHED:
        raise OSError(errno.EMFILE, f"descriptor {descriptor} is beyond the {MAX_WATCHED} that select() watches")
    return descriptor


def none_left() -> bool:
    """Return whether the process has no free descriptor, so that the kernel lets it accept no connection."""
    try:
        os.close(os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC))
    except OSError as error:
        return error.errno in {errno.EMFILE, errno.ENFILE}
    return False
