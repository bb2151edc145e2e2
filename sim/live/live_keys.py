"""Keys of the terminal of a watched simulation: polled, never waited for."""

import os
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from wallride.sim.live.live_conditions import KEYS, LiveConditions
from wallride.sim.live.stop_request import StopRequest
from wallride.sim.replay.keys import single_keys

QUIT = "q"
MAX_AT_ONCE = 64
LEGEND = (
    ("b p c", "box, person, clear"),
    ("f F", "grip"),
    ("n N", "noise"),
    ("o O", "dropouts"),
    ("t T", "trim"),
    ("l L", "delay"),
    ("d", "dirt"),
    ("w", "own parts"),
    ("q", "end"),
)
"""Keys, and the field of `LiveConditions.fields` that they change."""


@contextmanager
def pressing(live: LiveConditions | None, stop: StopRequest, *, wanted: bool) -> Iterator[Callable[[], None]]:
    """Yield a function that performs the keys pressed since the last call; without a terminal it does nothing."""
    restore = single_keys() if wanted else None
    if restore is None:
        yield lambda: None
        return
    try:
        yield lambda: handle_keys(_typed(), live, stop)
    finally:
        restore()


def handle_keys(typed: str, live: LiveConditions | None, stop: StopRequest) -> None:
    """Perform the typed keys; unknown letters are ignored."""
    for letter in typed:
        if letter == QUIT:
            stop.ask()
        elif live is not None and letter in KEYS:
            live.do(KEYS[letter])


def legend(fields: dict[str, str]) -> list[tuple[str, str]]:
    """Return the keys and the quantity that they change, with its present value."""
    return [(keys, f"{what} {fields.get(what, '')}".strip()) for keys, what in LEGEND]


def _typed() -> str:
    descriptor = sys.stdin.fileno()
    if not select.select([descriptor], [], [], 0)[0]:
        return ""
    return os.read(descriptor, MAX_AT_ONCE).decode(errors="ignore")
