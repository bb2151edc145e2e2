"""Vehicle parameters used by the control laws."""

from typing import Annotated

from pydantic import Field

from runtime.settings_base import Section

NAME_RULE = "1 to 32 of a-z, 0-9, - and _, beginning with a letter or digit"


class CarSettings(Section):
    """The vehicle, measured with a ruler. base_link is the middle of the rear axle (REP-105)."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")] = "car1"
    """The car's name, part of each of its topics: wallride/NAME/..."""
    wheelbase_m: Annotated[float, Field(gt=0.05, le=2.0)] = 0.33
    """From the front axle to the rear axle."""
    max_steering_rad: Annotated[float, Field(gt=0.05, lt=1.2)] = 0.34
    """The largest angle of the front wheels; no command is larger."""
    steering_rate_radps: Annotated[float, Field(gt=0, le=50)] = 3.2
    """How fast the servo turns the front wheels."""
    max_speed_mps: Annotated[float, Field(gt=0, le=20)] = 4.0
    """The fastest forward command that reaches the motor, from any driver."""
    max_reverse_mps: Annotated[float, Field(ge=0, le=5)] = 1.0
    """The fastest backward command that reaches the motor, from any driver."""
    max_acceleration_mps2: Annotated[float, Field(gt=0, le=20)] = 4.0
    """How fast the commanded speed may rise. Slowing down is never delayed."""
    lidar_x_m: Annotated[float, Field(ge=-1, le=2)] = 0.27
    """The lidar's place ahead of the rear axle."""
    front_m: Annotated[float, Field(gt=0, le=3)] = 0.42
    """From the rear axle to the front end of the car."""
    rear_m: Annotated[float, Field(gt=0, le=3)] = 0.13
    """From the rear axle to the rear end of the car."""
    half_width_m: Annotated[float, Field(gt=0, le=1)] = 0.15
    """Half of the car's greatest width, wheels and mirrors included."""
