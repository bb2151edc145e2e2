"""A race along a map's line, begun on a car that stands: map and law go into its settings file, and it starts anew.

`wallride param race MAP` and the page's button do it. Only on the car's computer, with its settings file: `map.file`
names a file of that computer, and is not set from afar. What the page says beside it: `clients/monitor/lap_map.py`.
"""

import argparse
import asyncio
import os
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any, Final

from wallride.clients.connection import ConnectionProblemError, connected
from wallride.clients.parameters import SAVED_WITHIN_S, ask
from wallride.runtime.host.terminal_text import one_line, say
from wallride.runtime.line_files import LINE_SUFFIX, check_course, read_line
from wallride.runtime.map_files import MapError, refusal_of
from wallride.runtime.parameters import file as settings_file
from wallride.runtime.parameters.catalogue import Value, shown, values
from wallride.runtime.parameters.file import StoreError
from wallride.runtime.settings.tree import SettingsError, load_settings
from wallride.runtime.wire.network import RefusedError

RESTART: Final = "restart"
IDENTITY: Final = ("car.name", "recording.simulated", "car.wheelbase_m")
"""Settings by which a settings file is recognized as that of a car."""
LIMITS: Final = ("wall_follow.speed_mps", "car.max_speed_mps")
"""Settings that a line is driven no faster than."""

Ask = Callable[[Mapping[str, Any]], Awaitable[Mapping[str, Any]]]
"""Puts a question about its restart to a car; RefusedError with the car's reason."""


async def run(options: argparse.Namespace) -> int:
    """Have the car race along a map; an error is one line, and then the settings file is as it was."""
    made = options.map.expanduser().absolute()
    try:
        line_mps = float(read_line(made.with_name(made.stem + LINE_SUFFIX), made).speed_mps.max())
        if refused := refusal_of(made):
            raise ConnectionProblemError(f"{made}: {refused}")
        check_course(made)
    except MapError as error:
        raise ConnectionProblemError(str(error)) from None
    async with connected(options, asks=True) as (bus, car):

        async def restart(question: Mapping[str, Any]) -> Mapping[str, Any]:
            try:
                return await ask(bus, car, RESTART, SAVED_WITHIN_S, **question)
            except ConnectionProblemError as error:  # no answer; the file may be written by now, which is to be told
                raise RefusedError(str(error)) from None

        try:
            told = (await ask(bus, car, "get", names=list(IDENTITY)))["values"]
            file, why_not = file_of(options.config, told)
            if file is None:
                raise ConnectionProblemError(why_not or "whose settings? Name the car's file: --config FILE")
            words = await race_along(file, made, line_mps, options.speed_mps or line_mps, restart)
        except (RefusedError, StoreError) as error:
            raise ConnectionProblemError(str(error)) from None
    say("\n".join(map(one_line, words)))
    return 0


async def race_along(file: Path, made: Path, line_mps: float, asked_mps: float, ask: Ask) -> tuple[str, ...]:
    """Write map and law into a car's settings file and start the car anew; return what was done, in sentences.

    made: the map. line_mps: highest speed of its line; asked_mps: that the car may reach. Raises: RefusedError and
    StoreError with the reason, before anything was written; StoreError, too, where another program wrote after it.
    """
    await ask({"only_ask": True})
    edits = race_edits(made, asked_mps)
    await asyncio.to_thread(settings_file.save, file, edits, edits)
    try:
        await ask({})
    except RefusedError as error:
        restarted = f"It counts from the car's next start: sudo systemctl restart wallride ({error})."
    else:
        restarted = "The car starts anew, disarmed."
    after = values(load_settings(file))
    if others := [f"{name} = {shown(after.get(name))}" for name, value in edits.items() if after.get(name) != value]:
        raise StoreError(f"{file} was changed by another program just now, and says {', '.join(others)}. {restarted}")
    most_mps = min(float(str(after[name])) for name in LIMITS)
    then = "Carry it to where the lap began, and permit it to drive: along the wall until it is located, then the line"
    return (
        f'{file}: map.file and wall_follow.method = "line" written, for {asked_mps:.1f} m/s.',
        f"{restarted} {then}, faster from lap to lap.",
        *(_slower(most_mps, line_mps) if most_mps < line_mps else ()),
        'Back to the wall, while it stands: wallride param set wall_follow.method="ball", then  wallride param save',
    )


def race_edits(made: Path, asked_mps: float) -> dict[str, Value]:
    """Return map, law and speed as they stand in the settings file of a car that is to race."""
    return {
        "map.file": str(made), "map.line": "", "wall_follow.method": "line",
        "wall_follow.speed_mps": round(asked_mps, 2),
    }  # fmt: skip


def file_of(config: Path | None, told: Mapping[str, Any]) -> tuple[Path | None, str]:
    """Return the settings file if it is the car's and can be written, and else why not.

    told: IDENTITY as the car says it.
    """
    if config is None:
        return None, ""
    try:
        here = values(load_settings(config))
    except SettingsError as error:
        return None, str(error)
    if other := [name for name in IDENTITY if here.get(name) != told.get(name)]:
        name = other[0]
        return None, f"{config} is of another car: {name} is {here.get(name)} in it, and {told.get(name)} on this car"
    if not os.access(config, os.W_OK) or not os.access(config.absolute().parent, os.W_OK):
        return None, f"{config} may not be written by you: start this with sudo"
    return config, ""


def _slower(most_mps: float, line_mps: float) -> tuple[str]:
    bound = f"It will drive at most {most_mps:g} m/s, and the line has {line_mps:.1f} m/s"
    return (f"{bound}: {' and '.join(LIMITS)} bound it, and can be changed while the car stands.",)
