"""Settings of an RPLIDAR. Range, sample rate and format come from the sensor where it tells them."""

from typing import Annotated, Literal

from pydantic import Field

from wallride.drivers.turning.settings import TurningSettings


class RplidarSettings(TurningSettings):
    """A Slamtec RPLIDAR: A1, A2, A3, S1, S2, S3, C1."""

    driver: Literal["rplidar"] = "rplidar"
    """Type of the lidar."""
    mode: Annotated[
        Literal["typical", "standard"],
        Field(description="Stream: the one that the sensor recommends, or plain samples, which every model sends."),
    ] = "typical"
    speed_rpm: Annotated[
        int, Field(ge=0, le=1200, description="Speed of the head of an S series sensor; 0: 600 rpm, 10 turns a second.")
    ] = 0
