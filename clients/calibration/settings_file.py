"""Calibrated values in the car's settings file, each with its origin; and the way back.

The values before are kept beside the file. `undo` puts back those that were not changed since.
"""

import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from wallride.runtime.calibration.proposals import Proposal
from wallride.runtime.parameters import toml_text
from wallride.runtime.parameters.file import StoreError, replace
from wallride.runtime.settings.tree import SettingsError, load_settings

SUFFIX = ".before-calibration.json"


def write(path: Path, accepted: Sequence[Proposal], date: str) -> Path:
    """Write the new values, and beside the file the old ones; StoreError where the file cannot take them.

    Returns the file of the old values.
    """
    kept = undo_file(path)
    text, tree = _read(path)
    earlier = kept.read_bytes() if kept.is_file() else None
    before = []
    for one in accepted:
        place = tuple(one.name.split("."))
        value = _value(tree, place)
        old = {"value": value, "comment": toml_text.comments(text).get(place, "")} if value is not None else None
        text = _set(path, text, place, one.new, f"calibrated {date}: {one.words}; was {one.old:g}")
        before.append({"name": one.name, "old": old, "new": one.new})
    replace(kept, json.dumps({"date": date, "changes": before}, indent=1).encode())
    try:
        _replace(path, text)
    except BaseException:  # the file is as before, and so is the way back
        if earlier is None:
            kept.unlink()
        else:
            replace(kept, earlier)
        raise
    return kept


def undo(path: Path) -> list[str]:
    """Put the values before the last calibration back; return a line for each. StoreError where none can be."""
    kept = undo_file(path)
    try:
        changes = json.loads(kept.read_text(encoding="utf-8"))["changes"]
    except FileNotFoundError:
        raise StoreError(f"{kept}: is not there, so there is nothing to undo for {path}") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{kept}: cannot be read: {error}") from None
    text, tree = _read(path)
    if all(_value(tree, change["name"].split(".")) != change["new"] for change in changes):
        raise StoreError(f"{path}: has none of the values of {kept} any more; nothing was put back")
    lines = []
    for change in changes:
        name, old = change["name"], change["old"]
        place = tuple(name.split("."))
        if _value(tree, place) != change["new"]:
            lines.append(f"{name}: changed since the calibration, left as it is")
        elif old is None:
            text = toml_text.remove(text, place)
            lines.append(f"{name}: {change['new']} -> not in the file, as before")
        else:
            text = _set(path, text, place, old["value"], old["comment"].removeprefix("#").strip())
            lines.append(f"{name}: {change['new']} -> {old['value']}")
    _replace(path, text)
    kept.unlink()
    return lines


def undo_file(path: Path) -> Path:
    """Return the file of the values before."""
    return path.with_name(f"{path.name}{SUFFIX}")


def _read(path: Path) -> tuple[str, dict[str, Any]]:
    try:
        text = path.read_bytes().decode("utf-8-sig")
        return text, tomllib.loads(text)
    except (OSError, RecursionError, ValueError) as error:
        raise StoreError(f"{path}: cannot be edited: {error}") from None


def _value(tree: Any, place: Sequence[str]) -> Any:  # noqa: ANN401 - whatever stood in the file
    for key in place:
        tree = tree.get(key) if isinstance(tree, Mapping) else None
    return tree


def _set(path: Path, text: str, place: tuple[str, ...], value: object, comment: str) -> str:
    try:
        return toml_text.set_value(text, place, value, comment)
    except ValueError as error:
        raise StoreError(f"{path}: {error}; nothing was saved") from None


def _replace(path: Path, text: str) -> None:
    """Write the file, whole or not at all, if the car would start with it."""

    def check(written: Path) -> None:
        try:
            load_settings(written)
        except (SettingsError, ValidationError) as error:
            raise StoreError(f"{str(error).replace(str(written), str(path))}; nothing was saved") from None

    replace(path.resolve(), text.encode(), like=path.stat(), check=check)  # a link to the file stays a link
