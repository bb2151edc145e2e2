"""Shape of a car's status, as far as screens on several cars read it. Pure.

A status comes from another computer: a car with a fault, or one that was taken over, may send anything under its own
name. What does not fit is refused whole, so that no reader meets a word where it expects a number.
"""

import json
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, StringConstraints

Short = Annotated[str, StringConstraints(max_length=64)]
Words = Annotated[str, StringConstraints(max_length=1000)]


class _Part(BaseModel):
    """A part of the status: exact types, finite numbers; what else is in it is not read."""

    model_config = ConfigDict(strict=True, extra="ignore", allow_inf_nan=False)


class _Condition(_Part):
    state: Short = ""


class _Output(_Part):
    winner: Short
    reason: Words
    speed_mps: float | None
    measure: float | None = None


class _Battery(_Part):
    voltage_v: float | None = None
    trouble: Words | None = None


class _Error(_Part):
    mean_abs_m: float | None = None


class _Status(_Part):
    """Every field may be missing: cars of other versions say less."""

    session: Short | None = None
    version: Short | None = None
    state: Short | None = None
    stamp_s: float | None = None
    speed_mps: float | None = None
    condition: _Condition | None = None
    output: _Output | None = None
    gates: dict[Short, Words] | None = None
    battery: _Battery | None = None
    distance_error: _Error | None = None


def check_status(status: Mapping[str, Any]) -> None:
    """Refuse a status of another shape: ValueError. The race checks the pose by itself.

    Every number is finite, also in parts that are not read here: `wallride cars --json` passes all of them on, and one
    Infinity among them (JSON's 1e999) would keep other programs from reading the rows of all cars.
    """
    _Status.model_validate(dict(status))
    json.dumps(dict(status), allow_nan=False)
