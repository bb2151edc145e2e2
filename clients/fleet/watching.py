"""A screen on several cars until Ctrl-C, with the e-stop to all of them under Space and Esc."""

import argparse
import asyncio
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from wallride.clients.fleet.links import FleetLink, telling_what_is_awaited, unheard, unopened
from wallride.clients.fleet.stop import PERIOD_S, FleetStop
from wallride.clients.refreshing import RefreshedScreen
from wallride.clients.teleop import terminal
from wallride.runtime.host.terminal_text import one_line

REFRESH_S = 0.2
STOP_KEYS = b" \x1b"
Keys = Mapping[int, tuple[str, Callable[[], None]]]
"""By the key's byte: what it does in words, and the function."""


async def watch(
    options: argparse.Namespace,
    links: Sequence[FleetLink],
    lines: Callable[[], Iterable[str]],
    keys: Keys | None = None,
) -> None:
    """Show the lines until Ctrl-C; Space or Esc stops every car, other keys as given."""
    async with telling_what_is_awaited(lambda: "" if sys.stdout.isatty() else unopened(links)):
        await _watch(options, links, lines, keys or {})


async def _watch(
    options: argparse.Namespace, links: Sequence[FleetLink], lines: Callable[[], Iterable[str]], others: Keys
) -> None:
    stop = FleetStop(links, options.name, options.car)
    console = terminal.Console() if terminal.is_there() else None
    if console is not None:
        console.open()
    shown, shown_s, pressed = RefreshedScreen(options.print_line), 0.0, False
    try:
        while True:
            now_s = time.monotonic()
            typed = set(console.read() or b"") if console is not None else set()
            if typed & set(STOP_KEYS):
                pressed = True
                stop.press(now_s)
            stop.step(now_s)
            for key in typed & others.keys():
                others[key][1]()
            if now_s - shown_s >= REFRESH_S:
                shown_s = now_s
                foot = _foot(links, stop if pressed else None, others)
                rows = list(map(one_line, lines()))
                shown.show("\n".join([*rows, *map(one_line, foot)]), "; ".join(rows))
            await asyncio.sleep(PERIOD_S)
    finally:
        if console is not None:
            console.close()


def _foot(links: Sequence[FleetLink], stop: FleetStop | None, keys: Keys) -> Iterator[str]:
    yield ""
    yield from (f"{link.endpoint}: {link.problem}" for link in links if link.problem)
    yield from unheard(links)
    if stop is None:
        others = "".join(f"; {chr(key)}: {words}" for key, (words, _) in keys.items())
        yield f"Space or Esc: e-stop to every car{others}"
    else:
        late = [car for car, took_s in stop.cars.items() if took_s is None]
        yield f"e-stop sent to every car{'; NOT CONFIRMED by ' + ', '.join(late) if late else ', all have latched'}"
