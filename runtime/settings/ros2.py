"""Settings of the ROS 2 face: the car's topics as ROS 2 finds them through rmw_zenoh."""

from typing import Annotated

from pydantic import Field

from wallride.runtime.settings_base import Section
from wallride.runtime.wire.rmw_zenoh import MAX_DOMAIN, Distro


class Ros2Settings(Section):
    """The [ros2] section; rates are those of [telemetry.rates_hz]."""

    enabled: bool = False
    """Publish the topics for ROS 2 as well; those without a subscriber are not written (docs/ros2.md)."""
    domain: Annotated[int, Field(ge=0, le=MAX_DOMAIN)] = 0
    """ROS_DOMAIN_ID of the ROS 2 computers."""
    distro: Distro = Distro.JAZZY
    """Distribution of the ROS 2 computers. Humble and later ones do not mix."""
    drive: bool = False
    """Take AckermannDriveStamped on /drive as the planner `ros2`; needs planners.enabled (docs/planners.md)."""
