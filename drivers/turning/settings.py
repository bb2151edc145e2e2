"""Settings that every lidar of a full circle has."""

import math
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, field_validator

from wallride.drivers.address import parse_address


class TurningSettings(BaseModel):
    """A lidar that turns a full circle and sends single samples."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    address: Annotated[str, Field(description="Address: serial:///dev/NAME, or tcp://HOST:PORT of a serial bridge")] = (
        "serial:///dev/wallride-lidar"
    )
    mounted_upside_down: Annotated[
        bool, Field(description="The sensor is mounted upside down: the order of the beams is reversed.")
    ] = False
    yaw_rad: Annotated[
        float, Field(ge=-math.pi, le=math.pi, description="Direction of the sensor's zero, left of straight ahead.")
    ] = 0.0
    stale_after_s: Annotated[
        float, Field(gt=0, le=1, description="Maximum delay of a delivered scan; a later one is dropped.")
    ] = 0.1
    degraded_after_s: Annotated[
        float, Field(gt=0, le=2, description="Time without a scan after which the lidar is not ready.")
    ] = 0.5
    silent_after_s: Annotated[
        float,
        Field(ge=0.2, le=60, description="Time without a scan after which the stream, then the link, is restarted."),
    ] = 1.0

    @field_validator("address")
    @classmethod
    def _is_an_address(cls, text: str) -> str:
        parse_address(text)
        return text
