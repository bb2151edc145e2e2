"""The parameter server: answers requests about settings and for changes; bytes in, bytes out, or a refusal as text.

Knows no bus. Every answer takes bounded time, and length is checked before content; the bus bounds their rate. The
settings in force are one frozen value that is replaced as a whole, so that half a change is never visible.
"""

import asyncio
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from wallride.drivers.api import Clock
from wallride.runtime.control.method_settings import METHODS
from wallride.runtime.parameters import file as settings_file
from wallride.runtime.parameters.catalogue import Value, catalogue, shown, values
from wallride.runtime.parameters.history import ChangeHistory, SettingChange
from wallride.runtime.parameters.policy import Effect, only_on_the_car
from wallride.runtime.parameters.requests import (
    MAX_QUESTION,
    ConfigureQuestion,
    GetParameters,
    HistoryQuestion,
    ListParameters,
    ParameterRequest,
    SaveQuestion,
    SetQuestion,
)
from wallride.runtime.parameters.update import UnacceptableError, UpdatePlan, looser, plan, read_texts
from wallride.runtime.settings.tree import Settings

MAX_REFUSAL = 600
KEY = "[key]"
"""Where pydantic finds fault with a key, not with its value."""
VALUES = "true, false, a finite number, a text, or a list of texts"

Q = TypeVar("Q", bound=ParameterRequest)


@dataclass(slots=True)
class Counts:
    """Counts of requests by outcome: malformed ones were not readable."""

    answered: int = 0
    refused: int = 0
    malformed: int = 0


@dataclass(frozen=True, slots=True)
class ServerContext:
    """The server's interface to the car.

    apply: takes the new settings and the names that changed, in one step of the loop; must not fail.
    is_standing: whether the wheels stand and no source drives. file: where to save, None where there is none.
    base: the file below that one, where it holds differences only.
    may_loosen: whether limits may be loosened while driving. date: date and time in UTC, for people.
    """

    apply: Callable[[Settings, Sequence[str]], None]
    is_standing: Callable[[], bool]
    clock: Clock
    date: Callable[[], str]
    file: Path | None = None
    may_loosen: bool = False
    base: Path | None = None


class ParameterServer:
    """Six requests, each a method from payload to reply; UnacceptableError is the refusal, with its reason.

    settings: those in force. counts: number of requests by outcome.
    """

    def __init__(self, settings: Settings, car: ServerContext, history: ChangeHistory) -> None:
        self.settings = settings
        self.history = history
        self.counts = Counts()
        self._car = car
        self._unsaved: set[str] = set()
        self._kept = values(settings)  # what the file has, or the start gave
        self._saving = asyncio.Lock()
        self._described = _Descriptions()
        read_texts(settings)  # before the car drives

    def list_all(self, payload: bytes) -> bytes:
        """Return all properties of every setting, and the names of those that were changed and not saved."""
        question = self._read(ListParameters, payload or b"{}")
        described = self._described.get(self.settings)
        listed = ",".join([text for name, text in described.items() if name.startswith(question.under)])
        self.counts.answered += 1
        return f'{{"parameters":[{listed}],"unsaved":{_json(sorted(self._unsaved))}}}'.encode()

    def get_some(self, payload: bytes) -> bytes:
        """Return the values of some settings."""
        question = self._read(GetParameters, payload)
        now = values(self.settings)
        if unknown := [name for name in question.names if name not in now]:
            raise self._refusal(f"{shown(unknown[0])[1:-1]} is not a setting; ask for the list of them")
        return self._answer(values={name: now[name] for name in question.names})

    def set_some(self, payload: bytes) -> bytes:
        """Change some values, all or none, at once."""
        question = self._read(SetQuestion, payload)
        wanted = self._plan(self.settings, question.values)
        self._object(wanted)
        if wanted.changed:
            names = [name for name, _, _ in wanted.changed]
            self._car.apply(wanted.settings, names)
            self.settings = wanted.settings
            now = values(wanted.settings)
            self._unsaved = {name for name in self._unsaved.union(names) if now.get(name) != self._kept.get(name)}
            self._remember(question.by, wanted)
        return self._answer(changed=_as_json(wanted), unsaved=sorted(self._unsaved))

    async def save(self, payload: bytes) -> bytes:
        """Write the values changed since the start into the car's file."""
        question = self._read(SaveQuestion, payload or b"{}")
        return await self._save(question.by, {})

    async def configure(self, payload: bytes) -> bytes:
        """Write the values changed since the start, and others for after a restart; an administrator's right."""
        question = self._read(ConfigureQuestion, payload)
        known = catalogue(self._plan(self.settings, question.values).settings)
        if now := [name for name in question.values if known[name].effect is not Effect.RESTART]:
            raise self._refusal(f"{now[0]} can be changed without a restart: set it, then save")
        if here := [(name, why) for name in question.values if (why := only_on_the_car(name))]:
            name, why = here[0]
            raise self._refusal(
                f"{name} {why}, and is not saved from afar: edit {self._car.file} on the car, then restart"
            )
        return await self._save(question.by, question.values)

    async def _save(self, by: str, wishes: Mapping[str, Value]) -> bytes:
        if self._car.file is None:
            raise self._refusal("this car runs without a settings file; start it with one: wallride run FILE")
        if self._saving.locked():
            raise self._refusal("a save is under way; try again in a moment")
        later = self._plan(self.settings, wishes)
        edits = self._edits(later.settings, wishes)
        if edits:
            async with self._saving:
                await self._write(self._car.file, edits)
            now = values(self.settings)
            self._kept = {name: value for name, value in {**self._kept, **edits}.items() if value is not None}
            self._unsaved -= {name for name in edits if now.get(name) == edits[name]}
            self._remember(by, later)
        return self._answer(saved=sorted(edits), file=str(self._car.file), after_restart=_as_json(later))

    def past(self, payload: bytes) -> bytes:
        """Return the newest changes, oldest first."""
        question = self._read(HistoryQuestion, payload or b"{}")
        return self._answer(changes=[asdict(change) for change in self.history.newest(question.most)])

    def _read(self, kind: type[Q], payload: bytes) -> Q:
        """Parse a request; one that is too long is not parsed."""
        if len(payload) > MAX_QUESTION:
            self.counts.malformed += 1
            raise UnacceptableError(f"{len(payload)} bytes are too long a question: at most {MAX_QUESTION}")
        try:
            return kind.model_validate_json(payload)
        except ValidationError as error:
            self.counts.malformed += 1
            raise UnacceptableError(_short(self._why_unreadable(error))) from None

    def _why_unreadable(self, error: ValidationError) -> str:
        """Return what is wrong with a request: with a value in it, such as NaN, or with its form."""
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        place = [str(part) for part in first["loc"]]
        if len(place) > 2 and place[0] == "values" and place[2] != KEY:
            known = catalogue(self.settings).get(place[1])
            return f"{place[1]}: must be {known.range_words() if known is not None else VALUES}"
        where = f"{'.'.join(place[:2])}: " if place else ""
        return f"not a question: {where}{first['msg']}"

    def _plan(self, settings: Settings, wishes: Mapping[str, object]) -> UpdatePlan:
        try:
            return plan(settings, wishes)
        except UnacceptableError as error:
            raise self._refusal(str(error)) from None

    def _object(self, wanted: UpdatePlan) -> None:
        """Refuse changes that are not allowed now."""
        effects = dict(_effects(wanted))
        later = [name for name, effect in effects.items() if effect is Effect.RESTART]
        if later:
            way = "edit the file on the car" if only_on_the_car(later[0]) else f"wallride param save {later[0]}=..."
            raise self._refusal(f"{', '.join(later)}: takes effect after a restart; save it and restart ({way})")
        if self._car.is_standing():
            return
        anew = [name for name, effect in effects.items() if effect is Effect.STANDING]
        if anew:
            raise self._refusal(f"{', '.join(anew)}: only while the car stands; stop it first")
        loose = looser(wanted)
        if loose and not self._car.may_loosen:
            raise self._refusal(
                f"{', '.join(loose)}: loosens safety while the car drives; stop it first"
                " (operator.loosen_safety_while_driving in its file allows it)"
            )

    def _edits(self, later: Settings, names: Iterable[str]) -> dict[str, Value | None]:
        """Return the edits to write, in the order of the tree; None for keys that were removed with their law."""
        now = values(self.settings)
        edits: dict[str, Value | None] = {name: None for name in self._unsaved if name not in now}
        edits |= {name: value for name, value in now.items() if name in self._unsaved}
        return edits | {name: values(later)[name] for name in names}

    async def _write(self, file: Path, edits: Mapping[str, Value | None]) -> None:
        expected = {name: value for name, value in edits.items() if value is not None}
        now = values(self.settings)
        sections = {name.partition(".")[0] for name in edits}
        expected |= {f"{section}.method": now[f"{section}.method"] for section in METHODS if section in sections}
        try:
            await asyncio.to_thread(settings_file.save, file, edits, expected, self._car.base)
        except settings_file.StoreError as error:
            raise self._refusal(str(error)) from None

    def _remember(self, by: str, wanted: UpdatePlan) -> None:
        who = "".join(letter for letter in by if letter.isprintable()).strip() or "unnamed"
        now_s, date = self._car.clock(), self._car.date()
        self.history.add([SettingChange(now_s, date, who, name, old, new) for name, old, new in wanted.changed])

    def _refusal(self, reason: str) -> UnacceptableError:
        self.counts.refused += 1
        return UnacceptableError(_short(reason))

    def _answer(self, **fields: object) -> bytes:
        self.counts.answered += 1
        return _json(fields).encode()


class _Descriptions:
    """The properties of every setting as JSON, kept for as long as the settings stay: made anew they take 3 ms."""

    def __init__(self) -> None:
        self._settings: Settings | None = None
        self._texts: dict[str, str] = {}

    def get(self, settings: Settings) -> Mapping[str, str]:
        """Return the texts by dotted name."""
        if settings is not self._settings:
            now = values(settings)
            self._texts = {name: _json(known.describe(now[name])) for name, known in catalogue(settings).items()}
            self._settings = settings
        return self._texts


def _json(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def _effects(wanted: UpdatePlan) -> list[tuple[str, Effect]]:
    """Return when each change takes effect; keys added or removed by a method take effect with it."""
    known = catalogue(wanted.settings)
    return [(name, known[name].effect) for name, _, _ in wanted.changed if name in known]


def _as_json(wanted: UpdatePlan) -> list[dict[str, Any]]:
    return [{"name": name, "old": old, "new": new} for name, old, new in wanted.changed]


def _short(text: str) -> str:
    text = text if len(text) <= MAX_REFUSAL else f"{text[: MAX_REFUSAL - 3]}..."
    return text.encode("ascii", "backslashreplace").decode("ascii")
