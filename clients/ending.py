"""Ctrl-C in a client: an orderly end at once, and an end within a second in any case."""

import asyncio
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Coroutine, Iterator
from contextlib import contextmanager
from typing import Any, Final

from wallride.runtime.ending import end

ENDS_WITHIN_S: Final = 0.8
"""Maximum time of an orderly end. A car stops by itself when its operator falls silent; nothing else is at stake."""
INTERRUPTED: Final = 130
"""Exit code of a program that was ended by Ctrl-C, as a shell reports it."""
NAMES: Final = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")

_last_resorts: list[threading.Timer] = []


def run_to_end(program: Coroutine[Any, Any, int]) -> int:
    """Run a client's coroutine and return its exit code; after Ctrl-C it ends in ENDS_WITHIN_S, with INTERRUPTED.

    Ctrl-C before `interrupted` waits reaches the coroutine as a cancellation.
    """
    last_resort = threading.Timer(ENDS_WITHIN_S, _exit)
    last_resort.daemon = True
    _last_resorts.append(last_resort)
    try:
        return asyncio.run(_attend(program))
    except KeyboardInterrupt:
        return INTERRUPTED
    finally:
        last_resort.cancel()
        _last_resorts.remove(last_resort)


@contextmanager
def stopping(stop: asyncio.Event) -> Iterator[None]:
    """Turn the signals that end a program, a closed terminal among them, into an orderly exit."""
    loop = asyncio.get_running_loop()

    def asked() -> None:
        _end_soon()
        stop.set()

    before: dict[int, Any] = {}
    for number in (getattr(signal, name) for name in NAMES if hasattr(signal, name)):
        before[number] = signal.getsignal(number)
        signal.signal(number, lambda *_: loop.call_soon_threadsafe(asked))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


async def interrupted() -> None:
    """Return when the user, or the system, ends the program."""
    stop = asyncio.Event()
    with stopping(stop):
        await stop.wait()


async def _attend(program: Coroutine[Any, Any, int]) -> int:
    work = asyncio.create_task(program)
    try:
        await asyncio.wait({work})
    except asyncio.CancelledError:  # Ctrl-C
        _end_soon()
        await end(work)
        raise
    return work.result()


def _end_soon() -> None:
    """End the process in a while, whatever still waits for a thread, for a peer, or for a task that does not end."""
    for timer in _last_resorts:
        with contextlib.suppress(RuntimeError):  # it runs already, or the system gives no thread
            timer.start()


def _exit() -> None:
    with contextlib.suppress(Exception):  # a closed pipe, or a lock that another thread holds for ever
        sys.stdout.flush()
    os._exit(INTERRUPTED)
