"""The map of a lap from a page: what `wallride logs get`, `map` and `line` do, one after the other, one map at a time.

Each runs in a process of its own (`command_run`): nothing is computed here, nor in the car. The recording is taken
where it lies, or fetched from a car on another computer. A monitor keeps the last map for all its pages.
"""

import asyncio
import logging
import tempfile
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from wallride.clients.monitor.command_run import CommandFailedError, RunCommand, run_command
from wallride.clients.monitor.lap_map import (
    ASKED,
    OF_THE_LINE,
    LapMap,
    Stage,
    line_told,
    map_told,
    map_words,
    maps_folder,
    newest_drive,
    recording_here,
    way_to_race,
)
from wallride.clients.monitor.messages import MapLap
from wallride.clients.race_along import RESTART, file_of, race_along
from wallride.runtime.ending import end
from wallride.runtime.line_files import LINE_SUFFIX
from wallride.runtime.parameters.file import StoreError
from wallride.runtime.recording import requests
from wallride.runtime.recording.ring import MB
from wallride.runtime.settings.tree import SettingsError
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import RefusedError

log = logging.getLogger("wallride.monitor")

FETCH_WITHIN_S: Final = 600.0
MAP_WITHIN_S: Final = 300.0
LINE_WITHIN_S: Final = 120.0
PICTURE: Final = ".png"
EXPECTED = (CommandFailedError, OSError, RefusedError, SettingsError, StoreError)
FAILED_HERE: Final = "It ended with an error of the program; the monitor's log has it."


@dataclass(frozen=True, slots=True)
class LapSource:
    """The car whose lap is to be mapped, as a page knows it.

    ask: puts a query to it. options: of a command line that leads to it. objection: why this page may not have a map
    made, or raced, now; "" when it may.
    """

    car: str
    ask: Callable[[str, Mapping[str, Any]], Awaitable[dict[str, Any]]]
    options: Sequence[str] = ()
    objection: str = ""


class LapMapper:
    """Makes maps. config: settings file that the monitor was started with, None without one. run: a command."""

    def __init__(self, config: Path | None, run: RunCommand = run_command) -> None:
        self._config, self._run = config, run
        self._working: asyncio.Task[None] | None = None
        self._now = LapMap()

    @property
    def is_busy(self) -> bool:
        """Return whether a map is being made, or settings written."""
        return self._working is not None and not self._working.done()

    def receive(self, word: MapLap, source: LapSource) -> None:
        """Do what a page wants; RefusedError where that may not be now. Any page may end what another one began."""
        if word.do == "cancel":
            self.cancel()
            return
        if source.objection:
            raise RefusedError(source.objection)
        if self.is_busy:
            raise RefusedError(f"a map of {self._now.car}'s lap is being made: wait for it, or cancel it")
        if word.do == "race":
            self._race(source, word.speed_mps)
        else:
            self._begin_map(source)

    def cancel(self) -> None:
        """End what is being made; settings that are being written are written whole."""
        if self._working is not None and self._now.stage != "saving":
            self._working.cancel()

    async def close(self) -> None:
        """End what is being done, and wait for that."""
        if self._working is not None:
            await end(self._working)

    def fields(self, car: str) -> Mapping[str, Any]:
        """Return the present for a page that shows a car."""
        if self._now.car == car:
            return {**self._now.fields(), "busy": self.is_busy}
        words = (f"A map of {self._now.car}'s lap is being made.",) if self.is_busy else ()
        return {**LapMap(car, words=words).fields(), "busy": self.is_busy}

    def picture(self, name: str) -> bytes | None:
        """Return a picture of the last map as PNG, None without one."""
        return self._now.picture(name)

    def _begin_map(self, source: LapSource) -> None:
        self._now = LapMap(source.car, "asking", number=self._now.number + 1)
        self._tell("asking", f"Asking {source.car} for its newest recording.")
        self._begin(lambda: self._make(source))

    def _race(self, source: LapSource, asked_mps: float | None) -> None:
        made = self._now
        if made.car != source.car or not made.can_be_raced:
            raise RefusedError(f"there is no map of {source.car}'s lap with a race line here: make it first")
        self._now = replace(made, stage="saving", refusal="")  # at once: `cancel` may come before the task's first step
        self._begin(lambda: self._race_along(made, source, asked_mps or made.fastest_mps))

    def _begin(self, work: Callable[[], Awaitable[None]]) -> None:
        self._working = asyncio.create_task(self._attempt(work), name="map of a lap")
        self._working.add_done_callback(self._ended)

    def _tell(self, stage: Stage, *words: str) -> None:
        self._now = replace(self._now, stage=stage, words=words)

    def _ended(self, task: "asyncio.Task[None]") -> None:
        if task.cancelled():
            self._tell("failed", "Cancelled.")

    async def _attempt(self, work: Callable[[], Awaitable[None]]) -> None:
        """Do it; whatever fails is told to the pages."""
        try:
            await work()
        except EXPECTED as error:
            self._tell("failed", str(error))
        except Exception:
            log.exception("a map of a lap failed")
            self._tell("failed", FAILED_HERE)

    async def _make(self, source: LapSource) -> None:
        folder, name, size_bytes = newest_drive(await source.ask(requests.LIST, {}), source.car)
        told = (await source.ask(f"{topics.PARAM}/get", {"names": list(ASKED)}))["values"]
        file, why_not = file_of(self._config, told)
        self._now = replace(self._now, recording=name, file=file)
        here = recording_here(folder, name, size_bytes)
        with tempfile.TemporaryDirectory(prefix="wallride-lap-", ignore_cleanup_errors=True) as place:
            recording = here or await self._fetch(source, name, size_bytes, Path(place))
            is_good = await self._map(recording, _target(maps_folder(file), source.car, name))
        if is_good and self._now.map is not None:
            await self._line(self._now.map, told)
        if is_good and self._now.fastest_mps and file is None:
            words, lines = way_to_race(self._now, told, is_here=here is not None)
            self._now = replace(self._now, words=(*self._now.words, *filter(None, [why_not, words])), lines=lines)

    async def _fetch(self, source: LapSource, name: str, size_bytes: int, place: Path) -> Path:
        self._tell("fetching", f"Fetching {name} from {source.car}: {size_bytes / MB:.0f} MB.")
        words = ["logs", "get", name, "--car", source.car, *source.options, "-o", str(place)]
        answer = await self._run(words, FETCH_WITHIN_S)
        if answer.code:
            raise CommandFailedError(f"The recording did not come over: {answer.reason}")
        return place / source.car / name

    async def _map(self, recording: Path, target: Path) -> bool:
        """Make the map; return whether it is good."""
        self._tell("mapping", f"Making the map of {recording.name}: some seconds, on a small computer ten or more.")
        answer = await self._run(["map", str(recording), "-o", str(target), "--json", "-"], MAP_WITHIN_S)
        told = map_told(answer)
        made, is_good = Path(str(told.get("map", target))), not told["reasons"]
        self._now = replace(self._now, map=made if is_good else None, pictures={"map": made.with_suffix(PICTURE)})
        self._tell("line" if is_good else "refused", *map_words(told, recording.name))
        return is_good

    async def _line(self, made: Path, told: Mapping[str, Any]) -> None:
        line, words = made.with_name(made.stem + LINE_SUFFIX), self._now.words
        self._tell("line", *words, "Computing the race line.")
        sets = [word for name in OF_THE_LINE for word in ("--set", f"{name}={told[name]}")]
        answer = await self._run(["line", str(made), "-o", str(line), *sets, "--json", "-"], LINE_WITHIN_S)
        sentence, fastest_mps = line_told(answer)
        pictures = {**self._now.pictures, **({"line": line.with_suffix(PICTURE)} if fastest_mps else {})}
        self._now = replace(self._now, fastest_mps=fastest_mps, pictures=pictures)
        self._tell("good", *words, sentence)

    async def _race_along(self, made: LapMap, source: LapSource, asked_mps: float) -> None:
        if made.file is None or made.map is None:
            return

        async def restart(question: Mapping[str, Any]) -> Mapping[str, Any]:
            return await source.ask(f"{topics.PARAM}/{RESTART}", question)

        try:
            words = await race_along(made.file, made.map, made.fastest_mps, asked_mps, restart)
        except EXPECTED as error:
            self._now = replace(made, refusal=str(error))
            return
        self._tell("saved", *words)


def _target(folder: Path, car: str, recording: str) -> Path:
    """Return the path of a map, in a folder of the car, which is made."""
    target = folder / car / f"{Path(recording).stem}.yaml"
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandFailedError(f"{target.parent}: no map can be put there: {error.strerror}") from None
    return target
