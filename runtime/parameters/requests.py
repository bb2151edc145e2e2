"""What may be asked about the settings, and how often: closed forms, bounded in every direction."""

from typing import Annotated

from pydantic import Field, StringConstraints

from runtime.wire.requests import Request

MAX_QUESTION = 4096
MAX_VALUES = 64
QUESTIONS_HZ = 25.0
"""So many of one kind are answered; a flood of them must not eat the time that driving needs."""

Name = Annotated[str, StringConstraints(max_length=64)]
Text = Annotated[str, StringConstraints(max_length=256)]
Wish = bool | int | float | Text | Annotated[list[Text], Field(max_length=16)]
Wishes = Annotated[dict[Name, Wish], Field(max_length=MAX_VALUES)]


class ParameterRequest(Request):
    """by: the client, in its own words."""

    by: Annotated[str, StringConstraints(max_length=24)] = ""


class ListParameters(ParameterRequest):
    """Which settings there are."""

    under: Name = ""
    """Only the settings whose names begin with this."""


class GetParameters(ParameterRequest):
    """What some settings are."""

    names: Annotated[list[Name], Field(min_length=1, max_length=MAX_VALUES)]


class SetQuestion(ParameterRequest):
    """Other values, please."""

    values: Annotated[Wishes, Field(min_length=1)]


class SaveQuestion(ParameterRequest):
    """Write down what was set."""

    values: Wishes = Field(default_factory=dict)
    """Settings that take effect after a restart, to be written as well."""


class HistoryQuestion(ParameterRequest):
    """What was changed."""

    most: Annotated[int, Field(ge=1, le=1000)] = 50


class RateLimit:
    """Lets QUESTIONS_HZ through per second, and as many at once after a pause."""

    def __init__(self) -> None:
        self._left = QUESTIONS_HZ
        self._last_s = 0.0

    def lets_through(self, now_s: float) -> bool:
        """Count one that wants through; tells whether it may."""
        self._left = min(QUESTIONS_HZ, self._left + QUESTIONS_HZ * (now_s - self._last_s))
        self._last_s = now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True
