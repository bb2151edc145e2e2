"""Settings of planners outside the car: which may drive in the follower's place, and for how long a command holds."""

from typing import Annotated

from pydantic import Field, StringConstraints, field_validator

from wallride.runtime.settings_base import Section

PlannerName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_-]{0,23}$")]


class PlannerSettings(Section):
    """The [planners] section. Planners stand below teleop, safety and permit, and above the car's own follower."""

    enabled: bool = False
    """Let programs outside the car drive in place of the follower, under safety and permit (docs/planners.md)."""
    names: Annotated[tuple[PlannerName, ...], Field(max_length=8)] = ()
    """Planners that may register, most urgent first; each name is that of a certificate with the role planner."""
    expiry_s: Annotated[float, Field(ge=0.1, le=0.5)] = 0.2
    """Lifetime of a planner's command, counted from the heartbeat that it echoes; then the car stops."""

    @field_validator("names")
    @classmethod
    def _distinct(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(names)) < len(names):
            raise ValueError("names the same planner twice; name it once")
        return names
