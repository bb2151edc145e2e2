"""Settings of those who command the car: operator, gamepad at the car, planners outside it."""

from typing import Annotated, Literal

from pydantic import Field, StringConstraints, field_validator

from wallride.drivers.section import Section

PlannerName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_-]{0,23}$")]


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


class JoystickSettings(Section):
    """A gamepad on the car's own computer: hold LB to drive, RB to permit, as with `wallride teleop`."""

    enabled: Literal["auto", "off"] = "auto"
    """auto: a gamepad that is plugged in drives, at any time. off: the car reads none, so that other programs can."""

    max_speed_mps: Annotated[float, Field(ge=0.1, le=20)] = 1.5
    """Speed at full stick; the limits of the car hold as well."""

    max_steering_rad: Annotated[float, Field(ge=0.05, le=0.8)] = 0.34
    """Steering at full stick."""

    layouts_folder: str = "/etc/wallride/pads"
    """Folder of layouts for unknown gamepads, written by `wallride teleop --map`."""


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
