"""Settings of telemetry: the topics sent over zenoh, their rates, and their form for ROS 2 through rmw_zenoh."""

from typing import TYPE_CHECKING, Annotated

from pydantic import Field, create_model

from wallride.drivers.section import Section
from wallride.runtime.wire import topics
from wallride.runtime.wire.rmw_zenoh import MAX_DOMAIN, Distro

Rate = Annotated[float, Field(ge=0, le=200)]
"""Maximum rate [1/s]; 0 is never. A topic is never sent more often than it changes."""


if TYPE_CHECKING:

    class RatesHz(Section):
        """Maximum rate of each topic."""

        def __init__(self, **rates_hz: float) -> None: ...

else:
    _RATES = {
        name: (Annotated[Rate, Field(description=f"Maximum rate; 0: off. Topic: {topic.meaning}.")], topic.rate_hz)
        for name, topic in topics.TELEMETRY.items()
    }
    RatesHz = create_model("RatesHz", __base__=Section, __module__=__name__, **_RATES)
"""Maximum rate of each topic; shaped for a Wi-Fi that ten cars share.

A subscriber to all topics receives 1.3 Mbit/s, 0.7 of it scans, and on a map up to 0.4 more; topics without
subscribers are not published. 200 is "every one", of output, distance_error, pose and imu; of everything else the
newest, at most 20 or 25 a second, because telemetry leaves in bursts.
"""


class TelemetryRates(Section):
    """Rates of the topics, a part of the [telemetry] section."""

    rates_hz: RatesHz = RatesHz()


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
