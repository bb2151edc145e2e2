"""The base class of every section of settings, of car and simulator: frozen, closed, and exact.

Declared beside its reader, composed in `runtime.settings` and `sim.scenario`.
"""

from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator


class Section(BaseModel):
    """A section of the settings tree: immutable, closed to unknown keys, and exact in numbers and booleans.

    `true` is no number, and text is neither: a slip of the pen must not become another value.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _of_its_kind(cls, value: Any, info: ValidationInfo) -> Any:  # noqa: ANN401 - as it was given
        kind = cls.model_fields[info.field_name or ""].annotation
        if kind is bool and not isinstance(value, bool):
            raise ValueError("must be true or false")
        if kind in {int, float} and isinstance(value, bool | str):
            raise ValueError("input should be a valid number, without quotes")
        return value
