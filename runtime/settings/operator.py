"""Settings of the operator's side: required inputs, and their maximum age."""

from typing import Annotated, Literal

from pydantic import Field

from runtime.settings_base import Section


class OperatorSettings(Section):
    """Inputs that the car requires from its operator, and their freshness."""

    permit: Literal["required", "always"] = "required"
    """required: autonomy moves only while an operator permits it. always: simulation and benches."""

    expiry_s: Annotated[float, Field(ge=0.1, le=0.5)] = 0.2
    """A command counts for so long after the car sent the beat that it echoes; then the car stops."""

    beat_hz: Annotated[float, Field(ge=30, le=100)] = 50.0
    """How often the car tells operators the time of its own clock; also how soon a silence is noticed."""

    slot_free_after_s: Annotated[float, Field(ge=1, le=60)] = 3.0
    """After so much silence of a lost operator another one may operate without taking over."""

    frozen_after_s: Annotated[float, Field(ge=0.3, le=10)] = 1.0
    """A gamepad that is held and moves the car without one event for so long is taken for frozen."""

    loosen_safety_while_driving: bool = False
    """Lets `wallride param set` loosen a safety limit of a moving car; otherwise it has to stand for that."""
