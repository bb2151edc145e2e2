"""The parameters of a study: settings by dotted name with their ranges, none of which may loosen safety."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from wallride.runtime.parameters.catalogue import Parameter, Value, ValueKind, catalogue, values
from wallride.runtime.parameters.policy import is_looser
from wallride.runtime.settings.tree import Settings
from wallride.sim.lab.command import FIXED_SETTINGS
from wallride.sim.lab.report.plan import GAIN_KEYS

LOWEST_FACTOR, HIGHEST_FACTOR = 0.5, 2.0
"""Range of a number without one, as multiples of its present value."""


class SpaceError(Exception):
    """Invalid parameter; the text names it and the valid form."""


@dataclass(frozen=True, slots=True)
class TunedParameter:
    """One parameter. choices: of a choice or a switch; else lowest and highest are its range."""

    name: str
    present: Value
    lowest: float = 0.0
    highest: float = 0.0
    whole: bool = False
    choices: tuple[bool | str, ...] = ()

    def range_words(self) -> str:
        """Return the range as text."""
        return " or ".join(map(str, self.choices)) if self.choices else f"{self.lowest:g} to {self.highest:g}"


def space_of(settings: Settings, texts: Sequence[str]) -> list[TunedParameter]:
    """Return the parameters of NAME or NAME=LOWEST:HIGHEST texts; without any, the law's gains.

    Raises SpaceError for an unknown or fixed setting, a bad range, and one that would loosen safety.
    """
    known, present = catalogue(settings), values(settings)
    wanted = list(texts) or [key for keys in GAIN_KEYS if all(key in known for key in keys) for key in keys]
    wanted = wanted or [name for name in known if name.startswith("wall_follow.own.")]
    if not wanted:
        raise SpaceError("--param: this law has no gains; name a setting, for example --param wall_follow.own.gain=1:3")
    found = [_parameter(text, known, present) for text in wanted]
    if len({one.name for one in found}) < len(found):
        raise SpaceError("--param: a setting is named twice")
    return found


def _parameter(text: str, known: Mapping[str, Parameter], present: Mapping[str, Value]) -> TunedParameter:
    name, equals, span = text.partition("=")
    name = name.strip()
    if name in FIXED_SETTINGS:
        raise SpaceError(f"--param {name}: every scenario has its own; it cannot be tuned")
    if name not in known:
        raise SpaceError(f"--param {name}: is not a setting of this law; `wallride check` lists all")
    about = known[name]
    if about.kind in {ValueKind.BOOLEAN, ValueKind.CHOICE}:
        if equals:
            raise SpaceError(f"--param {text}: leave the range out; it is {about.range_words()}")
        choices = (False, True) if about.kind is ValueKind.BOOLEAN else about.allowed
        made = TunedParameter(name, present[name], choices=choices)
        _refuse_looser(made, choices)
        return made
    if about.kind not in {ValueKind.NUMBER, ValueKind.INTEGER}:
        raise SpaceError(f"--param {name}: is {about.range_words()}; only numbers, switches and choices are tuned")
    lowest, highest = _span(text, span, about, present[name])
    made = TunedParameter(name, present[name], lowest, highest, about.kind is ValueKind.INTEGER)
    _refuse_looser(made, (lowest, highest))
    return made


def _span(text: str, span: str, about: Parameter, present: Value) -> tuple[float, float]:
    if span:
        low, _, high = span.partition(":")
        try:
            lowest, highest = float(low), float(high)
        except ValueError:
            raise SpaceError(f"--param {text}: write NAME=LOWEST:HIGHEST") from None
    else:
        value = float(present) if isinstance(present, int | float) else 0.0
        if value == 0:
            raise SpaceError(f"--param {text}: it is 0 now; write {about.name}=LOWEST:HIGHEST")
        lowest, highest = sorted((LOWEST_FACTOR * value, HIGHEST_FACTOR * value))
        lowest = lowest if about.lowest is None else max(lowest, about.lowest)
        highest = highest if about.highest is None else min(highest, about.highest)
    under = about.lowest is not None and (lowest < about.lowest or (about.open_below and lowest == about.lowest))
    over = about.highest is not None and (highest > about.highest or (about.open_above and highest == about.highest))
    if not lowest < highest or under or over:
        unbounded = about.lowest is None and about.highest is None
        within = "" if unbounded else f" and lie within {about.range_words()}"
        raise SpaceError(f"--param {text}: the range must grow{within}")
    return lowest, highest


def _refuse_looser(one: TunedParameter, ends: Sequence[object]) -> None:
    looser = next((end for end in ends if is_looser(one.name, one.present, end)), None)
    if looser is not None:
        raise SpaceError(
            f"--param {one.name}: {looser} would loosen safety, which is {one.present} now; tuning never does."
            f" Choose a range on the strict side of {one.present}, or leave it out"
        )
