"""Threads that code of the user has started: Python gives each of them a share of the loop's time."""

import sys
import threading
import traceback
from pathlib import Path


def threads_of(file: Path) -> tuple[int, Path, int]:
    """Return how many other threads run code of this file or of one beside it, and where one of them is."""
    here, count, path, line = threading.get_ident(), 0, file, 0
    for ident, frame in sys._current_frames().items():  # noqa: SLF001 - documented, "for specialized purposes"
        places = () if ident == here else traceback.walk_stack(frame)  # innermost first
        if own := [(name, at) for each, at in places if (name := Path(each.f_code.co_filename)).parent == file.parent]:
            count += 1
            path, line = own[0]
    return count, path, line
