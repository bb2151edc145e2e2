"""Settings of a lidar that is looked for at the start."""

from typing import Annotated, Literal

from pydantic import Field, field_validator

from wallride.drivers.address import parse_address
from wallride.drivers.lidar_settings import ConnectedLidarSettings


class AutoLidarSettings(ConnectedLidarSettings):
    """A lidar that is looked for once: `wallride run` writes what it found in place of `auto`.

    What is set here besides the address counts for the lidar that is found.
    """

    driver: Literal["auto"] = "auto"
    """Type of the lidar."""
    address: Annotated[
        str,
        Field(description="Where to look; empty: at every serial port but the motor's, and for a Hokuyo at its own."),
    ] = ""
    yaw_rad: Annotated[
        float, Field(ge=-3.15, le=3.15, description="Direction of the sensor's zero, left of straight ahead.")
    ] = 0.0
    degraded_after_s: Annotated[
        float,
        Field(gt=0, le=2, description="Time without a scan after which the lidar is not ready; a Hokuyo's is 0.25."),
    ] = 0.5

    @field_validator("address")
    @classmethod
    def _is_an_address(cls, text: str) -> str:
        if text:
            parse_address(text)
        return text
