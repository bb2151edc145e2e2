"""`wallride` with a way out of its process that a file chooses: WALLRIDE_WAY_OUT is its path, its text one of WAYS."""

import asyncio
import os
import sys
import threading
import time
from pathlib import Path
from typing import cast

from wallride.runtime import launch


def leave() -> None:
    """Call sys.exit in the loop."""
    sys.exit(3)


def interrupt() -> None:
    """Raise what Ctrl-C would raise without a handler."""
    raise KeyboardInterrupt


def end_loop() -> None:
    """Stop the event loop below every task."""
    asyncio.get_running_loop().stop()


def break_selector() -> None:
    """Let the loop itself fail, as select() does beyond its descriptors."""

    def broken(_timeout: float | None = None) -> None:
        raise ValueError("filedescriptor out of range in select()")

    vars(asyncio.get_running_loop())["_selector"].select = broken


def cancel_tasks() -> None:
    """Cancel every task."""
    for task in asyncio.all_tasks():
        task.cancel()


WAYS = {one.__name__: one for one in (leave, interrupt, end_loop, break_selector, cancel_tasks)}


def _watch(loop: asyncio.AbstractEventLoop, file: Path) -> None:
    while not file.exists():
        time.sleep(0.01)
    loop.call_soon_threadsafe(WAYS[file.read_text()])


if __name__ == "__main__":
    original = launch.PunctualLoop

    def watched_loop() -> asyncio.AbstractEventLoop:
        loop = original()
        file = Path(os.environ["WALLRIDE_WAY_OUT"])
        threading.Thread(target=_watch, args=(loop, file), daemon=True).start()
        return loop

    # A factory stands where the class stood; launch only calls it.
    launch.PunctualLoop = cast("type[launch.PunctualLoop]", watched_loop)
    from wallride.cli import main

    sys.exit(main())
