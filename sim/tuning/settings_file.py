"""The outcome as a settings file: each value with its provenance, loaded once to be sure that it can be used."""

from pathlib import Path

import tomlkit

from runtime.settings.tree import SettingsError, load_settings
from sim.tuning.study import TuningPlan
from sim.tuning.verdict import TuningVerdict

GIVEN = "given by --set"


def settings_text(plan: TuningPlan, verdict: TuningVerdict, version: str) -> str:
    """Return the file: the law, what was given, what was tuned. Everything else is the default."""
    follower, _, guard = plan.law.partition("+")
    document = tomlkit.document()
    for line in (
        f"Written by `wallride lab tune` (wallride {version}) from {verdict.trials} trials, seed {plan.seed}.",
        f"On its scenarios, conditions that no trial had: {verdict.fresh.words()}.",
        f"On scenarios that no trial had: {verdict.held_out.words()}.",
        *([f"In every drive: {', '.join(plan.conditions)}."] if plan.conditions else []),
        "Simulated. Wheels up and slowly first. Every setting that is not here is the default.",
    ):
        document.add(tomlkit.comment(line))
    _put(document, "wall_follow.method", follower, "given by --method")
    if guard not in {"swept", ""}:
        _put(document, "safety.method", guard, "given by --method")
    for text in plan.settings:
        key, _, given = text.partition("=")
        _put(document, key.strip(), _read(given), GIVEN)
    for one in plan.parameters:
        value = verdict.values[one.name]
        _put(document, one.name, value, f"trial {verdict.trial}, from {one.range_words()}; was {one.present}")
    return tomlkit.dumps(document)


def write_settings(path: Path, text: str) -> None:
    """Write the file and load it; SettingsError where it could not be used, which is a bug."""
    path.write_text(text, encoding="utf-8")
    try:
        load_settings(path)
    except SettingsError:
        path.unlink()
        raise


def _read(value: str) -> object:
    try:
        return tomlkit.parse(f"value = {value}")["value"]
    except tomlkit.exceptions.TOMLKitError:
        return value.strip()


def _put(document: tomlkit.TOMLDocument, name: str, value: object, comment: str) -> None:
    *sections, key = name.split(".")
    table: tomlkit.TOMLDocument | tomlkit.items.Table = document
    for section in sections:
        if section not in table:
            table[section] = tomlkit.table()
        below = table[section]
        if not isinstance(below, tomlkit.items.Table):
            raise TypeError(f"{name}: {section} is a value, not a section")
        table = below
    item = tomlkit.item(value)
    item.comment(comment)
    table[key] = item
