"""Settings of a Hokuyo lidar. All other parameters are read from the sensor itself."""

from typing import Annotated, Literal

from pydantic import Field

from wallride.drivers.lidar_settings import ConnectedLidarSettings


class HokuyoSettings(ConnectedLidarSettings):
    """A Hokuyo lidar with SCIP 2.x. Range limits, field of view and scan rate come from the sensor (PP)."""

    driver: Literal["hokuyo"] = "hokuyo"
    """Type of the lidar."""
    address: Annotated[str, Field(description="Address: tcp://HOST:PORT or serial:///dev/NAME?baud=115200")] = (
        "tcp://192.168.0.10:10940"
    )
    yaw_rad: Annotated[
        float, Field(ge=-0.6, le=0.6, description="Direction of the sensor's middle beam, left of straight ahead.")
    ] = 0.0
    degraded_after_s: Annotated[
        float, Field(gt=0, le=1, description="Time without a scan after which the lidar is not ready.")
    ] = 0.25
