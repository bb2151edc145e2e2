"""Settings that every lidar of a full circle has."""

from typing import Annotated

from pydantic import Field

from wallride.drivers.lidar_settings import ConnectedLidarSettings


class TurningSettings(ConnectedLidarSettings):
    """A lidar that turns a full circle and sends single samples."""

    address: Annotated[str, Field(description="Address: serial:///dev/NAME, or tcp://HOST:PORT of a serial bridge")] = (
        "serial:///dev/wallride-lidar"
    )
    yaw_rad: Annotated[
        float, Field(ge=-3.15, le=3.15, description="Direction of the sensor's zero, left of straight ahead.")
    ] = 0.0
    degraded_after_s: Annotated[
        float, Field(gt=0, le=2, description="Time without a scan after which the lidar is not ready.")
    ] = 0.5
