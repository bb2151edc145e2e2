"""`lidar.driver = "auto"`: the lidar that is found takes its place in the settings file, so that it is looked for once.

From then on the car starts with that lidar or says that it is missing: another one never takes its place unsaid.
"""

import asyncio
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import Final

from wallride.drivers.auto.identify import FoundLidar, find_lidar
from wallride.drivers.auto.ports import places
from wallride.drivers.auto.settings import AutoLidarSettings
from wallride.runtime.host.terminal_text import one_line
from wallride.runtime.parameters.catalogue import Value
from wallride.runtime.parameters.file import StoreError, save
from wallride.runtime.settings.devices import AnyMotorSettings, addresses
from wallride.runtime.settings.tree import SettingsError, read_tree

IDENTITY_CHARACTERS: Final = 80


async def look_for(lidar: AutoLidarSettings, motor: AnyMotorSettings) -> FoundLidar:
    """Return the one lidar at this computer; DriverError without one, or with several. Nothing is written."""
    taken = next((text for name, text in addresses(lidar, motor) if name.startswith("motor.")), "")
    return await find_lidar(lidar, places(lidar.address, taken), clock=asyncio.get_running_loop().time)


def write_down(
    found: FoundLidar, file: Path | None, saved: Path | None, assignments: Sequence[str], today: date
) -> str:
    """Write the lidar into the file that says "auto", and return where, or why not, in words for the owner.

    saved: the file above the other one, None without one.
    """
    words = f'lidar.driver = "auto": {found.identity} at {found.place}'
    lines = ", ".join(f"{name} = {value!r}" for name, value in edits(found).items())
    if any(one.partition("=")[0].strip() == "lidar.driver" for one in assignments):
        return f"{words}; not written down, as --set lidar.driver comes before every file: write {lines}"
    path, base = (saved, file) if saved is not None and _says_auto(saved) else (file, None)
    if path is None:
        return f"{words}; not written down, as there is no settings file: write {lines}"
    origin = f"found {today.isoformat()}: {one_line(found.identity, IDENTITY_CHARACTERS)}"
    try:
        save(path, edits(found), edits(found), base, origin=origin)
    except StoreError as error:
        return f"{words}; not written down, and looked for again at the next start: {error}; write {lines}"
    return f"{words}, written into {path}"


def edits(found: FoundLidar) -> dict[str, Value]:
    """Return what is to be written, by dotted name."""
    chosen = found.settings.model_dump(mode="json")
    names = ("driver", "address", *(("model",) if "model" in found.settings.model_fields_set else ()))
    return {f"lidar.{name}": chosen[name] for name in names}


def _says_auto(path: Path) -> bool:
    try:
        lidar = read_tree(path).get("lidar")
    except SettingsError:
        return False
    return isinstance(lidar, dict) and lidar.get("driver") == "auto"
