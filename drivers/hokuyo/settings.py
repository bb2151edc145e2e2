"""Settings of a Hokuyo lidar. All other parameters are read from the sensor itself."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from wallride.drivers.address import parse_address


class HokuyoSettings(BaseModel):
    """A Hokuyo lidar with SCIP 2.x. Range limits, field of view and scan rate come from the sensor (PP)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    driver: Literal["hokuyo"] = "hokuyo"
    """Type of the lidar."""
    address: Annotated[str, Field(description="Address: tcp://HOST:PORT or serial:///dev/NAME?baud=115200")] = (
        "tcp://192.168.0.10:10940"
    )
    mounted_upside_down: Annotated[
        bool, Field(description="The sensor is mounted upside down: the order of the beams is reversed.")
    ] = False
    yaw_rad: Annotated[
        float, Field(ge=-0.6, le=0.6, description="Direction of the sensor's middle beam, left of straight ahead.")
    ] = 0.0
    stale_after_s: Annotated[
        float, Field(gt=0, le=1, description="Maximum delay of a delivered scan; a later one is dropped.")
    ] = 0.1
    degraded_after_s: Annotated[
        float, Field(gt=0, le=1, description="Time without a scan after which the lidar is not ready.")
    ] = 0.25
    silent_after_s: Annotated[
        float,
        Field(ge=0.2, le=60, description="Time without a scan after which the stream, then the link, is restarted."),
    ] = 1.0

    @field_validator("address")
    @classmethod
    def _is_an_address(cls, text: str) -> str:
        parse_address(text)
        return text
