"""Settings of a recording: those at its beginning, with assigned changes, and the changes while it drove."""

import copy
import functools
import operator
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from wallride.runtime.recording.channels import SETTINGS
from wallride.runtime.settings.tree import Settings, SettingsError, in_file, load_settings, settings_from, to_toml
from wallride.sim.replay.drive_log import DriveLog
from wallride.sim.scenario.toml_lines import flat


@dataclass(frozen=True, slots=True)
class TunedSetting:
    """One setting that was changed while the car ran; None: it was, or is, not in the file."""

    stamp_ns: int
    name: str
    old: object
    new: object


def tuned_in(log: DriveLog) -> list[TunedSetting]:
    """Return the settings that were changed while the car ran, in order; unreadable ones are left out."""
    found: list[TunedSetting] = []
    last: Mapping[str, object] = {}
    for message in log.of(SETTINGS):
        try:
            now = flat(tomllib.loads(message.payload.decode(errors="replace")))
        except tomllib.TOMLDecodeError:
            continue
        found += [
            TunedSetting(message.stamp_ns, name, last.get(name), now.get(name))
            for name in dict.fromkeys([*last, *now] if last else ())
            if last.get(name) != now.get(name)
        ]
        last = now
    return found


def settings_of(log: DriveLog, assignments: Sequence[str] = (), *, laws: bool = True) -> Settings:
    """Return the settings; the defaults if none were recorded.

    assignments: KEY=VALUE, as on the command line. laws: import the own laws that the settings name, to decide again.
    Recorded settings that this version does not know are left out, with a note. SettingsError when assignments, or
    values of another version, do not fit, or a law is not found.
    """
    text = log.settings_text
    if not text:
        return load_settings(None, assignments, laws=laws)
    return _read(log.name, text, assignments, log.notes, laws=laws)


def with_assignments(settings: Settings, assignments: Sequence[str]) -> Settings:
    """Return settings with some changed; SettingsError when an assignment is unusable."""
    return _read("the recording", to_toml(settings), assignments, []) if assignments else settings


def known_part(tree: Any, notes: list[str]) -> Any:  # noqa: ANN401 - plain values as recorded
    """Return recorded settings without the keys that this version does not know; a note names those, once."""
    try:
        Settings.model_validate(tree)
    except ValidationError as error:
        places = [in_file(item["loc"]) for item in error.errors() if item["type"] == "extra_forbidden"]
    else:
        return tree
    tree = copy.deepcopy(tree)
    for *sections, key in places:
        del functools.reduce(operator.getitem, sections, tree)[key]
    names = ", ".join(".".join(map(str, place)) for place in places)
    note = f"its settings {names} are not known to this version: they are left out."
    if places and note not in notes:
        notes.append(note)
    return tree


def _read(name: str, text: str, assignments: Sequence[str], notes: list[str], *, laws: bool = True) -> Settings:
    try:
        tree = tomllib.loads(text)
    except (RecursionError, ValueError) as error:
        raise SettingsError(f"the settings of {name} cannot be read: {error}") from None
    return settings_from(known_part(tree, notes), assignments, laws=laws, name=f"the settings of {name}")
