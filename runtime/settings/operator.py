"""Settings of the operator's side: required inputs, and their maximum age."""

from typing import Annotated, Literal

from pydantic import Field

from wallride.runtime.settings_base import Section


class OperatorSettings(Section):
    """Inputs that the car requires from its operator, and their freshness."""

    permit: Literal["required", "always"] = "required"
    """required: autonomy moves only while an operator permits it. always: simulation and test benches."""

    expiry_s: Annotated[float, Field(ge=0.1, le=0.5)] = 0.2
    """Lifetime of an operator's command, counted from the heartbeat that it echoes; then the car stops."""

    beat_hz: Annotated[float, Field(ge=30, le=100)] = 50.0
    """Rate of the car's heartbeat and of the check for silent operators."""

    slot_free_after_s: Annotated[float, Field(ge=1, le=60)] = 3.0
    """Silence of a lost operator after which another one may operate without taking over."""

    frozen_after_s: Annotated[float, Field(ge=0.3, le=10)] = 1.0
    """Time without an event after which a held gamepad that moves the car counts as frozen."""

    loosen_safety_while_driving: bool = False
    """Allow `wallride param set` to loosen a safety limit while the car moves; false: only while it stands."""
