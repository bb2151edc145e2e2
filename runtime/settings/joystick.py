"""Settings of a gamepad that is plugged into the car."""

from typing import Annotated, Literal

from pydantic import Field

from wallride.runtime.settings_base import Section


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
