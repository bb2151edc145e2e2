"""Settings of every built-in lidar."""

from typing import Annotated

from pydantic import Field, field_validator

from wallride.drivers.address import parse_address
from wallride.drivers.section import Section


class ConnectedLidarSettings(Section):
    """A lidar at an address. A kind of lidar gives the defaults and the limits that this class leaves open."""

    address: str
    mounted_upside_down: Annotated[
        bool, Field(description="The sensor is mounted upside down: the order of the beams is reversed.")
    ] = False
    yaw_rad: float
    stale_after_s: Annotated[
        float, Field(gt=0, le=1, description="Maximum delay of a delivered scan; a later one is dropped.")
    ] = 0.1
    degraded_after_s: float
    silent_after_s: Annotated[
        float,
        Field(ge=0.2, le=60, description="Time without a scan after which the stream, then the link, is restarted."),
    ] = 1.0

    @field_validator("address")
    @classmethod
    def _is_an_address(cls, text: str) -> str:
        parse_address(text)
        return text
