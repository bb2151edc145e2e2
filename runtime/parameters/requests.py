"""Requests about settings, and their rate limit: closed forms, bounded in every direction."""

from typing import Annotated

from pydantic import Field, StringConstraints

from runtime.wire.requests import Request

MAX_QUESTION = 4096
MAX_VALUES = 64
QUESTIONS_HZ = 25.0
"""Maximum rate of answered requests of one kind; a flood of them must not take the time that driving needs."""

Name = Annotated[str, StringConstraints(max_length=64)]
Text = Annotated[str, StringConstraints(max_length=256)]
Wish = bool | int | float | Text | Annotated[list[Text], Field(max_length=16)]
Wishes = Annotated[dict[Name, Wish], Field(max_length=MAX_VALUES)]


class ParameterRequest(Request):
    """by: the client, as it names itself."""

    by: Annotated[str, StringConstraints(max_length=24)] = ""


class ListParameters(ParameterRequest):
    """Request for the list of settings."""

    under: Name = ""
    """Prefix of the names of the wanted settings."""


class GetParameters(ParameterRequest):
    """Request for the values of some settings."""

    names: Annotated[list[Name], Field(min_length=1, max_length=MAX_VALUES)]


class SetQuestion(ParameterRequest):
    """Request to change values."""

    values: Annotated[Wishes, Field(min_length=1)]


class SaveQuestion(ParameterRequest):
    """Request to save the changed values."""

    values: Wishes = Field(default_factory=dict)
    """Settings that take effect after a restart, to be written as well."""


class HistoryQuestion(ParameterRequest):
    """Request for the newest changes."""

    most: Annotated[int, Field(ge=1, le=1000)] = 50


class RateLimit:
    """Lets QUESTIONS_HZ through per second, and a burst of as many after a pause."""

    def __init__(self) -> None:
        self._left = QUESTIONS_HZ
        self._last_s = 0.0

    def lets_through(self, now_s: float) -> bool:
        """Count one request; tell whether it may pass."""
        self._left = min(QUESTIONS_HZ, self._left + QUESTIONS_HZ * (now_s - self._last_s))
        self._last_s = now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True
