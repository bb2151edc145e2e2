"""Settings of telemetry: the topics sent over zenoh, their rates, and their form for ROS 2 through rmw_zenoh."""

from typing import Annotated

from pydantic import Field

from wallride.runtime.settings_base import Section
from wallride.runtime.wire.rmw_zenoh import MAX_DOMAIN, Distro

Rate = Annotated[float, Field(ge=0, le=200)]
"""Maximum rate [1/s]; 0 is never. A topic is never sent more often than it changes."""


class RatesHz(Section):
    """Maximum rate of each topic; shaped for a Wi-Fi that ten cars share.

    A subscriber to all topics receives 1.3 Mbit/s, 0.7 of it scans, and on a map up to 0.4 more; topics without
    subscribers are not published. 200 is "every one", of output, distance_error, pose and imu; of everything else the
    newest, at most 20 or 25 a second, because telemetry leaves in bursts.
    """

    output: Rate = 200.0
    """Maximum rate of the command sent to the motor; 0: off."""
    distance_error: Rate = 200.0
    """Maximum rate of the follower's distance error; 0: off."""
    decision: Rate = 10.0
    """Maximum rate of the mux's decision; 0: off. A change is sent at once."""
    status: Rate = 10.0
    """Maximum rate of the state of the car; 0: off."""
    safety: Rate = 20.0
    """Maximum rate of safety's speed limit; 0: off."""
    navigation: Rate = 20.0
    """Maximum rate of the follower's command; 0: off."""
    teleop: Rate = 20.0
    """Maximum rate of the operator's command; 0: off."""
    joy: Rate = 20.0
    """Maximum rate of what the operator holds, as a gamepad; 0: off."""
    scan: Rate = 20.0
    """Maximum rate of the scans; 0: off."""
    odom: Rate = 20.0
    """Maximum rate of wheel odometry; 0: off."""
    tf: Rate = 20.0
    """Maximum rate of the frames map, odom, base_link and laser; 0: off."""
    pose: Rate = 20.0
    """Maximum rate of the pose on the map; 0: off."""
    map: Rate = 0.2
    """Maximum rate at which the map is repeated; 0: off."""
    line: Rate = 0.2
    """Maximum rate at which the race line is repeated; 0: off."""
    motor: Rate = 20.0
    """Maximum rate of speed and steering as joint states; 0: off."""
    imu: Rate = 50.0
    """Maximum rate of the motor controller's inertial measurements; 0: off."""
    wall: Rate = 10.0
    """Maximum rate of the markers of the followed wall; 0: off."""
    footprint: Rate = 10.0
    """Maximum rate of the markers of the swept path; 0: off."""
    battery: Rate = 1.0
    """Maximum rate of voltage and current of the battery; 0: off."""
    diagnostics: Rate = 1.0
    """Maximum rate of the diagnostics for ROS tools; 0: off."""


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
