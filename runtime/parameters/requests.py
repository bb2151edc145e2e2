"""Requests about settings: closed forms, bounded in every direction."""

from typing import Annotated

from pydantic import Field, StringConstraints

from wallride.runtime.wire.requests import Request

MAX_QUESTION = 4096
MAX_VALUES = 64

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


class ConfigureQuestion(SetQuestion):
    """Request to save the changed values, and others that take effect after a restart: an administrator's."""


class HistoryQuestion(ParameterRequest):
    """Request for the newest changes."""

    most: Annotated[int, Field(ge=1, le=1000)] = 50


class RestartQuestion(ParameterRequest):
    """Request for a new start of a car that stands."""

    only_ask: bool = False
    """Only asks whether the car could be restarted now: it goes on."""
