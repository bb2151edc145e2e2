"""The vehicle as control sees it."""

from typing import Annotated

from pydantic import Field

from runtime.section import Section


class CarSettings(Section):
    """The vehicle, measured with a ruler. base_link is the middle of the rear axle (REP-105)."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")] = "car1"
    wheelbase_m: Annotated[float, Field(gt=0.05, le=2.0)] = 0.33
    max_steering_rad: Annotated[float, Field(gt=0.05, lt=1.2)] = 0.34
    steering_rate_radps: Annotated[float, Field(gt=0, le=50)] = 3.2
    max_speed_mps: Annotated[float, Field(gt=0, le=20)] = 4.0
    max_reverse_mps: Annotated[float, Field(ge=0, le=5)] = 1.0
    max_acceleration_mps2: Annotated[float, Field(gt=0, le=20)] = 4.0
    """How fast the commanded speed may rise. Slowing down is never delayed."""
    lidar_x_m: Annotated[float, Field(ge=-1, le=2)] = 0.27
    front_m: Annotated[float, Field(gt=0, le=3)] = 0.42
    rear_m: Annotated[float, Field(gt=0, le=3)] = 0.13
    half_width_m: Annotated[float, Field(gt=0, le=1)] = 0.15
