"""The request for a new start of a car that stands: it reads its settings file anew, with map, line and law.

The car comes up as after every start: disarmed, in need of a fresh permit, with nothing learnt.
"""

import asyncio
import json
from collections.abc import Callable
from typing import Protocol

from pydantic import ValidationError

from wallride.runtime.parameters.requests import MAX_QUESTION, RestartQuestion
from wallride.runtime.parameters.update import UnacceptableError

NO_PROCESS = "this car is part of another program, and cannot be started anew alone: restart that program"
ALREADY = "the car is being restarted already"


class Restart(Protocol):
    """Ends the process and starts it again."""

    def check(self) -> None:
        """Read the files of the next start; may block. UnacceptableError where it would fail, or drive off."""

    def begin(self) -> None:
        """End the process, and have it start again."""


class RestartDesk:
    """Answers requests for a restart.

    objection: why there may be none now, "" where there may. restart: None for a car without a process of its own.
    """

    def __init__(self, objection: Callable[[], str], restart: Restart | None) -> None:
        self._objection, self._restart = objection, restart
        self._checking = False

    async def receive(self, payload: bytes) -> bytes:
        """Restart, or only tell whether that would be done; UnacceptableError with the reason why not."""
        if len(payload) > MAX_QUESTION:
            raise UnacceptableError(f"{len(payload)} bytes are too long a question: at most {MAX_QUESTION}")
        try:
            question = RestartQuestion.model_validate_json(payload or b"{}")
        except ValidationError as error:
            raise UnacceptableError(f"not a question: {error.errors(include_url=False)[0]['msg']}") from None
        self._object()
        if not question.only_ask:
            await self._begin()
        return json.dumps({"restarts": not question.only_ask}, separators=(",", ":")).encode()

    def _object(self) -> None:
        if self._restart is None:
            raise UnacceptableError(NO_PROCESS)
        if why_not := self._objection():
            raise UnacceptableError(f"no restart: {why_not}")

    async def _begin(self) -> None:
        if self._restart is None or self._checking:
            raise UnacceptableError(ALREADY)
        self._checking = True
        try:
            await asyncio.to_thread(self._restart.check)
            self._object()  # reading took a while
        except UnacceptableError:
            self._checking = False
            raise
        self._restart.begin()
