"""The recorder on the bus: begins and ends recordings; lists, sends and deletes files.

Files are read in threads, one piece at a time and slowly while the car is armed: neither the loop nor the radio link of
a driving car has time for them.
"""

import asyncio
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from wallride.runtime.recording import requests
from wallride.runtime.recording.disk import explain, opened
from wallride.runtime.recording.file_summary import duration_s
from wallride.runtime.recording.recorder import Recorder
from wallride.runtime.recording.recover import file_state
from wallride.runtime.recording.requests import GetRecording, ListRecordings, RecordQuestion, TrimQuestion
from wallride.runtime.recording.ring import MB, entries, parse, trim
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import RefusedError, Reply
from wallride.runtime.wire.requests import RequestServer

BEGINS_WITHIN_S = 1.0
LOOK_EVERY_S = 0.05
PIECE_EVERY_S = 0.01
PIECE_EVERY_ARMED_S = 0.1
MAX_ASKING = 8

Q = TypeVar("Q", bound=BaseModel)
T = TypeVar("T")


def serve(bus: RequestServer, car: str, recorder: Recorder) -> None:
    """Answer `record` and `logs/list|get|trim` of a car."""
    library = Library(recorder)
    replies: dict[str, Reply] = {
        requests.RECORD: library.record,
        requests.LIST: library.list_all,
        requests.GET: library.get,
        requests.TRIM: library.trim,
    }
    for name, reply in replies.items():
        bus.answer(topics.key(car, name), reply)


class Library:
    """Answers the requests; RefusedError carries the reason of a refusal."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._desk = asyncio.Lock()
        self._asking = 0

    async def record(self, payload: bytes) -> bytes:
        """Begin or end a recording or leave that to the settings, wait until it happened, and return the state."""
        question = _read(RecordQuestion, payload)
        wish = question.on
        if wish is not None and question.by_itself:
            raise RefusedError("on and by_itself contradict each other: send one of them")
        if wish and not self._recorder.is_enabled:
            raise RefusedError("recording is turned off on this car: recording.enabled = false")
        if wish is not None or question.by_itself:
            self._recorder.request(on=wish)
            await self._followed(wish)
        return topics.encode(self._recorder.status())

    async def _followed(self, wish: bool | None) -> None:  # noqa: FBT001 - the request's own value
        """Wait until the recorder's thread has done what was asked, for at most BEGINS_WITHIN_S."""
        for _ in range(round(BEGINS_WITHIN_S / LOOK_EVERY_S)):
            status = self._recorder.status()
            if not status["why"].startswith("asked ") if wish is None else status["on"] is wish:
                return
            await asyncio.sleep(LOOK_EVERY_S)

    async def list_all(self, payload: bytes) -> bytes:
        """Return every recording, oldest first."""
        _read(ListRecordings, payload)
        return topics.encode(await self._in_turn(lambda: _listing(self._recorder.folder)))

    async def get(self, payload: bytes) -> bytes:
        """Return a piece of a file: fewer bytes than requested at its end, none beyond it."""
        question = _read(GetRecording, payload)
        if parse(question.name) is None:  # also refuses every path outside the folder
            raise RefusedError(f"{question.name!r} is not the name of a recording; see wallride logs list")
        path = self._recorder.folder / question.name
        return await self._in_turn(lambda: _piece(path, question.offset, question.length))

    async def trim(self, payload: bytes) -> bytes:
        """Delete the oldest files; return their names."""
        question = _read(TrimQuestion, payload)
        found = await self._in_turn(lambda: trim(self._recorder.folder, question.keep_mb * MB))
        return topics.encode({"deleted": found.deleted, "refused": found.refused})

    async def _in_turn(self, read: Callable[[], T]) -> T:
        """Read in a thread, one request after the other, with a pause after each."""
        if self._asking >= MAX_ASKING:
            raise RefusedError("too many are asking for recordings; try again")
        self._asking += 1
        try:
            async with self._desk:
                answer = await asyncio.to_thread(read)
                await asyncio.sleep(PIECE_EVERY_ARMED_S if self._recorder.is_armed else PIECE_EVERY_S)
                return answer
        except OSError as error:
            raise RefusedError(_why(error)) from None
        finally:
            self._asking -= 1


def _listing(folder: Path) -> dict[str, Any]:
    return {
        "folder": str(folder),
        "files": [
            {
                "name": entry.name,
                "size_bytes": entry.size_bytes,
                "black_box": entry.is_black_box,
                "reason": entry.reason,
                "state": file_state(folder / entry.name),
                "duration_s": duration_s(folder / entry.name),
            }
            for entry in entries(folder)
        ],
    }


def _piece(path: Path, offset: int, length: int) -> bytes:
    with opened(path, os.O_NOFOLLOW) as file:
        return os.pread(file.fileno(), length, offset)


def _why(error: OSError) -> str:
    if isinstance(error, FileNotFoundError):
        return "that recording is not there (any more); see wallride logs list"
    if isinstance(error, PermissionError):
        return "the car's user may not read that recording or its folder"
    return explain(error)


def _read(form: type[Q], payload: bytes) -> Q:
    if len(payload) > requests.MAX_QUESTION_B:
        raise RefusedError("the question is too long")
    try:
        return form.model_validate_json(payload or b"{}")
    except ValidationError as error:
        first = error.errors()[0]
        raise RefusedError(f"{'.'.join(map(str, first['loc'])) or 'the question'}: {first['msg']}") from None
