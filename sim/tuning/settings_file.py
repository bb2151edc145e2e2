"""The outcome as a settings file: each value with its provenance, loaded once to be sure that it can be used."""

import tomllib
from pathlib import Path

from wallride.runtime.host.output_files import write_file
from wallride.runtime.parameters.toml_text import set_value
from wallride.runtime.settings.tree import SettingsError, load_settings
from wallride.sim.tuning.study import TuningPlan
from wallride.sim.tuning.verdict import TuningVerdict

GIVEN = "given by --set"


def settings_text(plan: TuningPlan, verdict: TuningVerdict, version: str) -> str:
    """Return the file: the law, what was given, what was tuned. Everything else is the default."""
    follower, _, guard = plan.law.partition("+")
    head = (
        f"Written by `wallride lab tune` (wallride {version}) from {verdict.trials} trials, seed {plan.seed}.",
        f"On its scenarios, conditions that no trial had: {verdict.fresh.words()}.",
        f"On scenarios that no trial had: {verdict.held_out.words()}.",
        *([f"In every drive: {', '.join(plan.conditions)}."] if plan.conditions else []),
        "Simulated. Wheels up and slowly first. Every setting that is not here is the default.",
    )
    text = "".join(f"# {line}\n" for line in head)
    text = _put(text, "wall_follow.method", follower, "given by --method")
    if guard not in {"swept", ""}:
        text = _put(text, "safety.method", guard, "given by --method")
    for assignment in plan.settings:
        key, _, given = assignment.partition("=")
        text = _put(text, key.strip(), _read(given), GIVEN)
    for one in plan.parameters:
        value = verdict.values[one.name]
        text = _put(text, one.name, value, f"trial {verdict.trial}, from {one.range_words()}; was {one.present}")
    return text


def write_settings(path: Path, text: str) -> None:
    """Write the file and load it; SettingsError where it could not be used, which is a bug."""
    write_file(path, text)
    try:
        load_settings(path)
    except SettingsError:
        path.unlink()
        raise


def _read(value: str) -> object:
    try:
        return tomllib.loads(f"value = {value}")["value"]
    except (RecursionError, ValueError):
        return value.strip()


def _put(text: str, name: str, value: object, comment: str) -> str:
    return set_value(text, tuple(name.split(".")), value, comment)
