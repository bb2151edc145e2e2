"""The parameter server on the bus, and the history file of its changes."""

import asyncio
import logging
from pathlib import Path
from typing import Never

from wallride.runtime.parameters.catalogue import shown
from wallride.runtime.parameters.file import StoreError, replace
from wallride.runtime.parameters.history import ChangeHistory, SettingChange
from wallride.runtime.parameters.restart import RestartDesk
from wallride.runtime.parameters.server import ParameterServer
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import Reply
from wallride.runtime.wire.requests import RequestServer

log = logging.getLogger("wallride.parameters")

MIN_WRITE_PERIOD_S = 1.0
MAX_NAMED = 3


def serve(bus: RequestServer, car: str, desk: ParameterServer, restart: RestartDesk) -> None:
    """Answer `param/list|get|set|save|configure|history|restart` of a car."""
    replies: dict[str, Reply] = {
        "list": desk.list_all,
        "get": desk.get_some,
        "set": desk.set_some,
        "save": desk.save,
        "configure": desk.configure,
        "history": desk.past,
        "restart": restart.receive,
    }
    for name, reply in replies.items():
        bus.answer(topics.key(car, f"{topics.PARAM}/{name}"), reply)


async def keep_history(history: ChangeHistory, file: Path | None) -> Never:
    """Log changes and append them to a file, in a thread and at most once a second, whatever their rate."""
    news = asyncio.Event()
    history.notify = news.set
    told = history.added
    while True:
        await news.wait()
        news.clear()
        fresh, told = history.newest(history.added - told), history.added
        log.info("%s", _words(fresh))
        if file is not None:
            await _write(file, history.lines())
        await asyncio.sleep(MIN_WRITE_PERIOD_S)


def read_history(history: ChangeHistory, file: Path) -> None:
    """Load the history of earlier runs; blocks, to be called before the car drives."""
    try:
        bad = history.read(file.read_text(errors="replace").splitlines())
    except FileNotFoundError:
        return
    except OSError as error:
        log.warning("%s: the history of parameters cannot be read: %s", file, error.strerror)
        return
    if bad:
        log.warning("%s: %d lines are no changes and are left out", file, bad)


async def _write(file: Path, lines: str) -> None:
    try:
        await asyncio.to_thread(replace, file, lines.encode())
    except StoreError as error:
        log.warning("the history of parameters: %s", error)


def _words(changes: list[SettingChange]) -> str:
    said = [f"{change.name} {shown(change.old)} -> {shown(change.new)}" for change in changes[-MAX_NAMED:]]
    more = f" and {len(changes) - MAX_NAMED} more before" if len(changes) > MAX_NAMED else ""
    return f"{changes[-1].by} changed {', '.join(said)}{more}"
