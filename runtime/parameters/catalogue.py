"""The catalogue of settings: each by its dotted name, with type, range, unit and description. Pure."""

import ast
import functools
import inspect
import itertools
import operator
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import to_jsonable_python

from wallride.runtime.control.method_settings import METHODS, name_of
from wallride.runtime.control.own_laws.law_class import loaded
from wallride.runtime.own_drivers.driver_class import loaded_drivers
from wallride.runtime.parameters.policy import Effect, Loosens, effect_of, loosens_by
from wallride.runtime.settings.devices import DRIVERS
from wallride.runtime.settings.tree import Settings

Value = bool | int | float | str | Sequence[str]
"""Types of a setting's value, as in JSON and TOML."""

SHOWN_CHARACTERS = 40
UNITS: Mapping[str, str] = {
    "_mps2_per_a": "m/s2/A",
    "_per_rad": "1/rad",
    "_radps": "rad/s",
    "_mps2": "m/s2",
    "_mps": "m/s",
    "_rad": "rad",
    "_hz": "Hz",
    "_ms": "ms",
    "_m": "m",
    "_s": "s",
    "_a": "A",
    "_v": "V",
    "_share": "1",
    "_mu": "1",
}
"""Units by the end of a name, longer ends first."""
LAWS: Mapping[str, str] = {"wall_follow": "Wall-following law", "safety": "Safety law"}


class ValueKind(StrEnum):
    """Kinds of values."""

    NUMBER = "number"
    INTEGER = "integer"
    BOOLEAN = "boolean"
    TEXT = "text"
    CHOICE = "choice"
    LIST = "list"


@dataclass(frozen=True, slots=True)
class Parameter:
    """One setting.

    lowest, highest: bounds, None where there is none; `open_below`, `open_above`: the bound itself is not allowed.
    allowed: the options of a choice. words: one line, from the text under the field.
    """

    name: str
    kind: ValueKind
    default: Value
    lowest: float | None
    highest: float | None
    open_below: bool
    open_above: bool
    allowed: tuple[str, ...]
    unit: str
    words: str
    effect: Effect
    loosens: Loosens

    def range_words(self) -> str:
        """Return the allowed values as text: "from 0 to 20 rad/m", "'left' or 'right'"."""
        match self.kind:
            case ValueKind.BOOLEAN:
                return "true or false"
            case ValueKind.CHOICE:
                return " or ".join(f"'{word}'" for word in self.allowed)
            case ValueKind.TEXT:
                return "a text"
            case ValueKind.LIST:
                return "a list of texts"
            case ValueKind.INTEGER:
                what = "a whole number"
            case ValueKind.NUMBER:
                what = "a number"
        unit = "" if self.unit == "1" else self.unit
        return " ".join(filter(None, (what, self._bounds_words(), unit)))

    def _bounds_words(self) -> str:
        if None not in {self.lowest, self.highest} and not self.open_below and not self.open_above:
            return f"from {self.lowest:g} to {self.highest:g}"
        below = "" if self.lowest is None else f"{'above' if self.open_below else 'at least'} {self.lowest:g}"
        above = "" if self.highest is None else f"{'below' if self.open_above else 'at most'} {self.highest:g}"
        return " and ".join(filter(None, (below, above)))

    def takes(self, value: object) -> bool:
        """Tell whether a value has the right type; pydantic alone would take "0.5" or true for a number."""
        match self.kind:
            case ValueKind.BOOLEAN:
                return isinstance(value, bool)
            case ValueKind.CHOICE:
                return isinstance(value, str) and value in self.allowed
            case ValueKind.TEXT:
                return isinstance(value, str)
            case ValueKind.LIST:
                return isinstance(value, list | tuple) and all(isinstance(item, str) for item in value)
            case ValueKind.INTEGER | ValueKind.NUMBER:
                return isinstance(value, int | float) and not isinstance(value, bool)

    def describe(self, value: Value) -> dict[str, Any]:
        """Return all properties as plain values."""
        return {
            "name": self.name,
            "type": self.kind,
            "value": value,
            "default": self.default,
            "lowest": self.lowest,
            "highest": self.highest,
            "open_below": self.open_below,
            "open_above": self.open_above,
            "allowed": list(self.allowed),
            "range": self.range_words(),
            "unit": self.unit,
            "description": self.words,
            "takes_effect": self.effect,
            "loosens": self.loosens,
        }


def catalogue(settings: Settings) -> Mapping[str, Parameter]:
    """Return every setting of the selected laws, by dotted name, in the order of the tree."""
    return {
        name: parameter
        for section, above in _sections(settings)
        for name, parameter in _of(
            section, above, loaded(above.rstrip(".")) + loaded_drivers(above.rstrip("."))
        ).items()
    }


def values(settings: Settings) -> dict[str, Value]:
    """Return every value by dotted name."""
    tree = settings.model_dump(mode="json")
    return {name: functools.reduce(operator.getitem, name.split("."), tree) for name in catalogue(settings)}  # type: ignore[misc]


def shown(value: object) -> str:
    """Format a value for people: short, and printable in any case."""
    text = repr(value)
    text = text if len(text) <= SHOWN_CHARACTERS else f"{text[: SHOWN_CHARACTERS - 3]}..."
    return text.encode("ascii", "backslashreplace").decode("ascii")


def _sections(section: BaseModel, above: str = "") -> Iterator[tuple[type[BaseModel], str]]:
    """Yield every section of the tree, with the prefix of its keys."""
    yield type(section), above
    for name in type(section).model_fields:
        part = getattr(section, name)
        if isinstance(part, BaseModel):
            yield from _sections(part, f"{above}{name}.")


@functools.cache
def _of(section: type[BaseModel], above: str, own: tuple[str, ...]) -> Mapping[str, Parameter]:
    """Return the settings directly in a section. Reads its source once, for the texts under the fields.

    own: names of the user's laws or drivers that may be selected in this section.
    """
    texts = _texts(section)
    found = {}
    for name, field in section.model_fields.items():
        if not isinstance(field.get_default(call_default_factory=True), BaseModel):
            text = _laws_in_words(above + name) or field.description or texts.get(name, "")
            found[above + name] = _parameter(above + name, field, text, own)
    return found


def _laws_in_words(name: str) -> str:
    """Return what the laws are that a setting selects, by the first sentence of each; "" for any other setting."""
    section, _, key = name.rpartition(".")
    if key != "method" or section not in METHODS:
        return ""
    said = ((name_of(law), _one_line(law.__doc__ or "").partition(".")[0]) for law in METHODS[section])
    laws = "".join(f"{law}: {words[:1].lower()}{words[1:]}. " for law, words in said)
    return f"{LAWS[section]}. {laws}MODULE:CLASS: one of your own."


def _parameter(name: str, field: FieldInfo, text: str, own: tuple[str, ...]) -> Parameter:
    bounds: dict[str, float] = {}
    for item in field.metadata:
        bounds |= {end: getattr(item, end) for end in ("ge", "gt", "le", "lt") if hasattr(item, end)}
    default = to_jsonable_python(field.get_default(call_default_factory=True))
    kind, allowed = _kind(name, field.annotation, own)
    return Parameter(
        name=name,
        kind=kind,
        default=default,
        lowest=bounds.get("ge", bounds.get("gt")),
        highest=bounds.get("le", bounds.get("lt")),
        open_below="gt" in bounds,
        open_above="lt" in bounds,
        allowed=allowed,
        unit=_unit(name, text),
        words=_one_line(text),
        effect=effect_of(name),
        loosens=loosens_by(name),
    )


def _kind(
    name: str,
    annotation: Any,  # noqa: ANN401 - an annotation is anything
    own: tuple[str, ...],
) -> tuple[ValueKind, tuple[str, ...]]:
    section, _, key = name.rpartition(".")
    if key == "method" and section in METHODS:
        return ValueKind.CHOICE, (*map(name_of, METHODS[section]), *own)
    if key == "driver" and section in DRIVERS:
        return ValueKind.CHOICE, (*(str(one.model_fields["driver"].default) for one in DRIVERS[section]), *own)
    if get_origin(annotation) is Literal:
        return ValueKind.CHOICE, tuple(str(word) for word in get_args(annotation))
    if get_origin(annotation) in {tuple, list}:
        return ValueKind.LIST, ()
    kinds = {bool: ValueKind.BOOLEAN, int: ValueKind.INTEGER, float: ValueKind.NUMBER}
    return kinds.get(annotation, ValueKind.TEXT), ()


def _unit(name: str, text: str) -> str:
    for end, unit in UNITS.items():
        if name.endswith(end) or name.rpartition(".")[0].endswith(end):  # [telemetry.rates_hz] names its keys' unit
            return unit
    found = re.search(r"\[([^\]\s]{1,12})\]", text)
    return "" if found is None else found[1].replace("-", "1")


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _texts(section: type[BaseModel]) -> dict[str, str]:
    """Return the text under each field, including base classes; none where the source is not available."""
    texts: dict[str, str] = {}
    for base in reversed(section.__mro__):
        if not issubclass(base, BaseModel) or base is BaseModel:
            continue
        try:
            body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
        except (OSError, SyntaxError):
            continue
        lines = body.body if isinstance(body, ast.ClassDef) else []
        for field, text in itertools.pairwise(lines):
            match field, text:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(words))):
                    texts[name] = words
    return texts
