"""Settings of a lidar whose scans another program publishes."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from wallride.runtime.ros.graph import PUBLISHED


class TopicLidarSettings(BaseModel):
    """Scans as sensor_msgs/LaserScan over zenoh, from ROS 2 through rmw_zenoh."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    driver: Literal["topic"] = "topic"
    """Type of the lidar."""
    topic: Annotated[
        str,
        Field(
            pattern=r"^[a-z][a-z0-9_]*(/[a-z][a-z0-9_]*)*$", description="Name of the topic, without a slash in front."
        ),
    ] = "lidar/scan"
    stale_after_s: Annotated[
        float, Field(gt=0, le=1, description="Maximum age of a scan by its stamp; a later one is dropped.")
    ] = 0.1
    degraded_after_s: Annotated[
        float, Field(gt=0, le=2, description="Time without a scan after which the lidar is not ready.")
    ] = 0.5

    @field_validator("topic")
    @classmethod
    def _is_not_the_cars_own(cls, name: str) -> str:
        if name in {topic.name for topic in PUBLISHED.values()}:
            raise ValueError(f"the car itself publishes /{name}: have the lidar's driver publish under another name")
        return name
