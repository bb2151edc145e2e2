"""`wallride param`: lists, shows, changes and saves a driving car's settings remotely."""

import argparse
import json
import tomllib
from collections.abc import Sequence
from typing import Any

from wallride.clients.answers import ANSWER_WITHIN_S, asked, reading
from wallride.clients.connection import ConnectionProblemError, connected
from wallride.runtime.host.ownership import user_name
from wallride.runtime.host.terminal_text import in_columns, one_line, say
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import RefusedError

SAVED_WITHIN_S = 10.0
"""Timeout of saving: a worn SD card may take seconds to confirm a write."""
MAX_NAME_LENGTH = 24


async def run(options: argparse.Namespace) -> int:
    """Run one `wallride param` command and print its result; an error is one line."""
    actions = {"list": _list, "get": _get, "set": _set, "save": _save, "history": _history}
    async with connected(options, asks=True) as (bus, car):
        try:
            with reading(car, "answer"):
                text = await actions[options.action](bus, car, options)
        except RefusedError as error:
            raise ConnectionProblemError(str(error)) from None
    say(text)
    return 0


async def ask(bus: Bus, car: str, what: str, timeout_s: float = ANSWER_WITHIN_S, **question: object) -> dict[str, Any]:
    """Send one request to a car's parameter server; RefusedError with its reason, ConnectionProblemError on timeout."""
    payload = json.dumps(question, default=_plain).encode()
    answer = await asked(bus, car, f"{topics.PARAM}/{what}", payload, timeout_s)
    with reading(car, "answer"):
        return topics.decode(answer)


def _plain(value: Any) -> object:  # noqa: ANN401 - whatever a program sets
    """Return a number of numpy as one of Python; TypeError for what is none."""
    if not hasattr(value, "item"):
        raise TypeError(f"a {type(value).__name__} is no value of a setting")
    return value.item()


def parsed(assignments: Sequence[str]) -> dict[str, object]:
    """Return the values of `NAME=VALUE` texts, each read as TOML would, or as bare text."""
    values: dict[str, object] = {}
    for assignment in assignments:
        name, equals, text = assignment.partition("=")
        if not equals or not name.strip():
            raise ConnectionProblemError(f"{assignment}: write NAME=VALUE, for example wall_follow.kp=10")
        if any("\ud800" <= letter <= "\udfff" for letter in assignment):  # bytes of the terminal that are no UTF-8
            raise ConnectionProblemError(f"{assignment}: is not text in UTF-8")
        if name.strip() in values:
            raise ConnectionProblemError(f"{assignment}: {name.strip()} is given twice")
        values[name.strip()] = _value(text.strip())
    return values


def table(parameters: Sequence[dict[str, Any]]) -> str:
    """Return settings as lines of columns: name, value, range, time of effect, and description."""
    rows = []
    for parameter in parameters:
        changed = "" if parameter["value"] == parameter["default"] else f" (default {_text(parameter['default'])})"
        when = {"now": "", "standing": "[while standing] ", "restart": "[after a restart] "}[parameter["takes_effect"]]
        rows.append(
            (
                parameter["name"],
                _text(parameter["value"]) + changed,
                parameter["range"],
                when + parameter["description"],
            )
        )
    return "\n".join(map(one_line, in_columns(rows)))


async def _list(bus: Bus, car: str, options: argparse.Namespace) -> str:
    found = (await ask(bus, car, "list", under=options.under))["parameters"]
    return json.dumps(found, indent=2) if options.json else table(found)


async def _get(bus: Bus, car: str, options: argparse.Namespace) -> str:
    found = (await ask(bus, car, "get", names=options.names))["values"]
    if options.json:
        return json.dumps(found, indent=2)
    if len(found) == 1:
        return _text(next(iter(found.values())))
    return "\n".join(f"{one_line(name)} = {_text(value)}" for name, value in found.items())


async def _set(bus: Bus, car: str, options: argparse.Namespace) -> str:
    found = await ask(bus, car, "set", values=parsed(options.assignments), by=user_name("")[:MAX_NAME_LENGTH])
    said = _changes(found["changed"]) or "nothing changed: these are its values already"
    if found["unsaved"]:
        unsaved = one_line(", ".join(found["unsaved"]))
        said += f"\nuntil the restart; not saved yet: {unsaved} (wallride param save)"
    return said


async def _save(bus: Bus, car: str, options: argparse.Namespace) -> str:
    wanted = parsed(options.assignments)
    if wanted:
        found = await ask(bus, car, "configure", SAVED_WITHIN_S, values=wanted, by=user_name("")[:MAX_NAME_LENGTH])
    else:
        found = await ask(bus, car, "save", SAVED_WITHIN_S, by=user_name("")[:MAX_NAME_LENGTH])
    if not found["saved"]:
        return "nothing to save: nothing was changed since the start"
    said = one_line(f"saved to {found['file']}: {', '.join(found['saved'])}")
    return f"{said}\nafter a restart: {_changes(found['after_restart'])}" if found["after_restart"] else said


async def _history(bus: Bus, car: str, options: argparse.Namespace) -> str:
    found = (await ask(bus, car, "history", most=options.most))["changes"]
    if options.json:
        return json.dumps(found, indent=2)
    lines = [
        one_line(
            f"{change['at']}  {change['by']:<{MAX_NAME_LENGTH}}  {change['name']}:"
            f" {_text(change['old'])} -> {_text(change['new'])}"
        )
        for change in found
    ]
    return "\n".join(lines) or "nothing was changed"


def _changes(changes: Sequence[dict[str, Any]]) -> str:
    lines = (f"{change['name']}: {_text(change['old'])} -> {_text(change['new'])}" for change in changes)
    return "\n".join(map(one_line, lines))


def _text(value: object) -> str:
    return "(none)" if value is None else one_line(value if isinstance(value, str) else json.dumps(value))


def _value(text: str) -> object:
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (RecursionError, ValueError):
        return text
    return value if isinstance(value, bool | int | float | str | list) else text
