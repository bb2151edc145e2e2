"""Calibrated values in the car's settings file, each with its origin; and the way back.

The values before are kept beside the file. `undo` puts back those that were not changed since.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import ValidationError
from tomlkit.exceptions import TOMLKitError

from runtime.calibration.proposals import Proposal
from runtime.parameters.file import StoreError, replace
from runtime.settings.tree import SettingsError, load_settings

SUFFIX = ".before-calibration.json"


def write(path: Path, accepted: Sequence[Proposal], date: str) -> Path:
    """Write the new values, and beside the file the old ones; StoreError where the file cannot take them.

    Returns the file of the old values.
    """
    kept = undo_file(path)
    document = _document(path)
    before = []
    for one in accepted:
        section, _, key = one.name.rpartition(".")
        table = document.setdefault(section, tomlkit.table())
        old = {"value": table[key].unwrap(), "comment": table.item(key).trivia.comment} if key in table else None
        item = tomlkit.item(one.new)
        item.comment(f"calibrated {date}: {one.words}; was {one.old:g}")
        table[key] = item
        before.append({"name": one.name, "old": old, "new": one.new})
    replace(kept, json.dumps({"date": date, "changes": before}, indent=1).encode())
    _replace(path, document)
    return kept


def undo(path: Path) -> list[str]:
    """Put the values before the last calibration back; return a line for each. StoreError without any."""
    kept = undo_file(path)
    try:
        changes = json.loads(kept.read_text(encoding="utf-8"))["changes"]
    except FileNotFoundError:
        raise StoreError(f"{kept}: is not there, so there is nothing to undo for {path}") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{kept}: cannot be read: {error}") from None
    document = _document(path)
    lines = [_put_back(document, change) for change in changes]
    _replace(path, document)
    kept.unlink()
    return lines


def undo_file(path: Path) -> Path:
    """Return the file of the values before."""
    return path.with_name(f"{path.name}{SUFFIX}")


def _put_back(document: Any, change: Mapping[str, Any]) -> str:  # noqa: ANN401 - tomlkit's containers share no type
    name, old = change["name"], change["old"]
    section, _, key = name.rpartition(".")
    table = document.get(section, {})
    if key not in table or table[key] != change["new"]:
        return f"{name}: changed since the calibration, left as it is"
    if old is None:
        del table[key]
        if not table:
            del document[section]
        return f"{name}: {change['new']} -> not in the file, as before"
    item = tomlkit.item(old["value"])
    if old["comment"]:
        item.comment(old["comment"].removeprefix("#").strip())
    table[key] = item
    return f"{name}: {change['new']} -> {old['value']}"


def _document(path: Path) -> tomlkit.TOMLDocument:
    try:
        return tomlkit.parse(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, TOMLKitError) as error:
        raise StoreError(f"{path}: cannot be edited: {error}") from None


def _replace(path: Path, document: tomlkit.TOMLDocument) -> None:
    """Write the file, whole or not at all, if the car would start with it."""

    def check(written: Path) -> None:
        try:
            load_settings(written)
        except (SettingsError, ValidationError) as error:
            raise StoreError(f"{str(error).replace(str(written), str(path))}; nothing was saved") from None

    replace(path, tomlkit.dumps(document).encode(), like=path.stat(), check=check)
