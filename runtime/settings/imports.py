"""Code of the user that the settings name: where it is looked for, and its import."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wallride.runtime.control.own_laws.law_class import ANSWERS, NAME, OWN_TAG, load_law
from wallride.runtime.host.user_module import UserCodeError, search_in
from wallride.runtime.own_drivers.driver_class import is_own, load_driver
from wallride.runtime.settings.devices import DRIVER_TAGS, OWN_DRIVERS


def search_beside(file: Path | None) -> None:
    """Look for code of the user in the working directory, beside a settings file, and in `laws` beside that."""
    for folder in [Path.cwd(), *([file.parent, file.parent / "laws"] if file is not None else [])]:
        if folder.is_dir():
            search_in(folder)


def import_named(tree: Mapping[str, Any], *, laws: bool, drivers: bool) -> list[Mapping[str, Any]]:
    """Import the own laws and drivers that a tree names, before it is validated; return mistakes in pydantic's form."""
    if not (laws or drivers):
        return []
    search_in(Path.cwd())
    process = tree.get("process")
    named = process.get("laws_folder") if isinstance(process, Mapping) else None
    if isinstance(named, str) and named:
        search_in(Path(named))
    mistakes: list[Mapping[str, Any]] = []
    wanted = [(one, "method") for one in ANSWERS if laws] + [(one, "driver") for one in OWN_DRIVERS if drivers]
    for section, choice in wanted:
        values = tree.get(section)
        name = values.get(choice) if isinstance(values, Mapping) else None
        if not isinstance(name, str):
            continue
        try:
            if choice == "driver" and name not in DRIVER_TAGS and is_own(section, name):
                load_driver(section, name)
            elif choice == "method" and NAME.fullmatch(name):  # another form is refused by the section
                load_law(section, name)
        except UserCodeError as error:
            place = {"loc": (section, OWN_TAG, choice), "type": "value_error"}
            mistakes.append({**place, "input": name, "msg": str(error)})
    return mistakes
