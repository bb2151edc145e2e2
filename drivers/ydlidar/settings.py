"""Settings of a YDLIDAR."""

from typing import Annotated, Literal

from pydantic import Field

from wallride.drivers.turning.settings import TurningSettings


class YdlidarSettings(TurningSettings):
    """A YDLIDAR. Models that never answer (X2, X4 Pro) have to be named."""

    driver: Literal["ydlidar"] = "ydlidar"
    """Type of the lidar."""
    model: Annotated[
        Literal["auto", "x2", "x4", "x4-pro", "g4", "g6", "tg"],
        Field(description="Model: auto asks the sensor; x2 and x4-pro never answer and have to be named."),
    ] = "auto"
