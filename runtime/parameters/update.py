"""The settings after a change of values: the next tree, or the reason of a refusal. Pure."""

import difflib
import functools
import operator
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ValidationError

from wallride.runtime.control.method_settings import METHODS, OWN_METHODS, kept_by_new_method, name_of
from wallride.runtime.control.own_laws.law_class import is_own, loaded
from wallride.runtime.parameters.catalogue import Parameter, Value, catalogue, shown, values
from wallride.runtime.parameters.policy import is_looser
from wallride.runtime.settings.tree import Settings, in_file
from wallride.runtime.wire.network import RefusedError

_BOUNDS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")


class UnacceptableError(RefusedError):
    """The values cannot be accepted; the text names each key and its allowed values. Nothing was changed."""


@dataclass(frozen=True, slots=True)
class UpdatePlan:
    """settings: the whole tree after the change. changed: (name, old, new) of every difference."""

    settings: Settings
    changed: tuple[tuple[str, Value | None, Value | None], ...]


def plan(settings: Settings, wishes: Mapping[str, object]) -> UpdatePlan:
    """Return the settings after a change, all values or none; UnacceptableError names each reason.

    The whole tree is validated again, so that rules between keys hold too. A new `method` begins with the defaults of
    its law; settings that mean the same in every law are kept.
    """
    base = _with_methods(settings, wishes)
    known = catalogue(base)
    wrong = [_objection(name, value, known) for name, value in wishes.items()]
    if any(wrong):
        raise UnacceptableError("; ".join(filter(None, wrong)))
    tree = base.model_dump(mode="json")
    for name, value in wishes.items():
        *sections, key = name.split(".")
        functools.reduce(operator.getitem, sections, tree)[key] = value
    try:
        new = Settings.model_validate(tree)
    except ValidationError as error:
        found = error.errors(include_url=False)
        raise UnacceptableError("; ".join(dict.fromkeys(_sentence(item, known, wishes) for item in found))) from None
    return UpdatePlan(new, tuple(_differences(values(settings), values(new))))


def looser(plan_: UpdatePlan) -> list[str]:
    """Return the names of the limits that a plan loosens."""
    return [name for name, old, new in plan_.changed if is_looser(name, old, new)]


def read_texts(settings: Settings) -> None:
    """Read the texts of every setting of every law from the sources now, so that no request waits for the disk."""
    for section, laws in METHODS.items():
        for law in laws:
            catalogue(_with_methods(settings, {f"{section}.method": name_of(law)}))


def _with_methods(settings: Settings, wishes: Mapping[str, object]) -> Settings:
    """Return the settings with the selected laws and their defaults; the settings themselves where no law changes."""
    tree = settings.model_dump(mode="json")
    for section, laws in METHODS.items():
        models = {name_of(law): law for law in laws}
        models |= dict.fromkeys(loaded(section), OWN_METHODS[section])
        method = wishes.get(f"{section}.method")
        if isinstance(method, str) and method in models and method != tree[section]["method"]:
            kept = kept_by_new_method(section, tree[section]["method"], method)
            kept = kept.intersection(models[method].model_fields, tree[section])
            tree[section] = _of_law(models[method], method, {key: tree[section][key] for key in kept})
    return Settings.model_validate(tree)


def _of_law(law: type[BaseModel], method: str, kept: Mapping[str, object]) -> dict[str, object]:
    """Return the section of a law with the kept values, without those beyond its bounds: `line` alone drives 20 m/s."""
    section = {"method": method, **kept}
    try:
        law.model_validate(section)
    except ValidationError as error:
        beyond = {item["loc"][0] for item in error.errors(include_url=False) if item["loc"]}
        return {key: value for key, value in section.items() if key not in beyond}
    return section


def _objection(name: str, value: object, known: Mapping[str, Parameter]) -> str:
    """Return the first error of a requested value: an unknown setting, or its type; "" for none."""
    if name not in known:
        return _unknown(name, known)
    if known[name].takes(value):
        return ""
    said = f"{name} = {shown(value)}: must be {known[name].range_words()}"
    unknown_law = name.endswith(".method") and isinstance(value, str) and is_own(value)
    return (
        f"{said}; a law of your own is loaded at the start only: name it in the file, restart" if unknown_law else said
    )


def _differences(
    old: Mapping[str, Value], new: Mapping[str, Value]
) -> Iterator[tuple[str, Value | None, Value | None]]:
    for name in [*new, *(name for name in old if name not in new)]:
        if old.get(name) != new.get(name):
            yield name, old.get(name), new.get(name)


def _sentence(error: Mapping[str, Any], known: Mapping[str, Parameter], wishes: Mapping[str, object]) -> str:
    """Format one of pydantic's errors: key, value, allowed values."""
    name = ".".join(str(part) for part in in_file(error["loc"]))
    # A rule of a whole section, or of one item of a list, is violated by the request for a key.
    name = name if name in wishes else next((wish for wish in wishes if f"{wish}.".startswith(f"{name}.")), name)
    name = next((wish for wish in wishes if name.startswith(f"{wish}.")), name)
    wish = f"{name} = {shown(wishes.get(name, error['input']))}"
    if name in known and error["type"] in {*_BOUNDS, "finite_number", "int_from_float", "literal_error"}:
        return f"{wish}: must be {known[name].range_words()}"
    message = str(error["msg"]).removeprefix("Value error, ")
    return f"{wish}: {message[:1].lower()}{message[1:]}"


def _unknown(name: str, known: Mapping[str, Parameter]) -> str:
    section = name.rpartition(".")[0]
    here = [other.removeprefix(f"{section}.") for other in known if other.rpartition(".")[0] == section]
    sections = dict.fromkeys(other.partition(".")[0] for other in known)
    hint = f"known in {section}: {', '.join(here)}" if section and here else f"sections: {', '.join(sections)}"
    near = difflib.get_close_matches(name, known, 1)
    meant = f"did you mean {near[0]}? " if near else ""
    return f"{shown(name)[1:-1]} is not a setting; {meant}{hint}"
