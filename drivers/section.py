"""The base class of every section of settings, of car and simulator: frozen, closed, and exact.

Declared beside its reader, composed in `runtime.settings` and `sim.scenario`.
"""

from collections.abc import Sequence
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator


class Section(BaseModel):
    """A section of the settings tree: immutable, closed to unknown keys, and exact in numbers and booleans.

    `true` is no number, and text is neither: a slip of the pen must not become another value.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _of_its_kind(cls, value: Any, info: ValidationInfo) -> Any:  # noqa: ANN401 - as it was given
        _check_kind(cls.model_fields[info.field_name or ""].annotation, value)
        return value


def _check_kind(kind: Any, value: object) -> None:  # noqa: ANN401 - an annotation
    """ValueError for what pydantic would take for a number or a boolean, and is none; also within tuples and lists."""
    origin, parts = get_origin(kind), [part for part in get_args(kind) if part is not NoneType]
    if kind is bool and not isinstance(value, bool):
        raise ValueError("must be true or false")
    if (kind is int or kind is float) and isinstance(value, bool | str):
        raise ValueError("input should be a valid number, without quotes")
    if origin is Annotated or (origin in {Union, UnionType} and len(parts) == 1 and value is not None):
        _check_kind(parts[0], value)
    elif origin in {tuple, list} and isinstance(value, Sequence) and not isinstance(value, str):
        same = len(parts) == 1 or parts[-1] is ...
        for number, each in enumerate(value):
            _check_kind(parts[0 if same else min(number, len(parts) - 1)], each)
