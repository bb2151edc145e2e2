"""Settings of telemetry: the topics sent over zenoh, and their rates."""

from typing import Annotated

from pydantic import Field

from runtime.settings_base import Section

Rate = Annotated[float, Field(ge=0, le=200)]
"""Maximum rate [1/s]; 0 is never. A topic is never sent more often than it changes."""


class RatesHz(Section):
    """Maximum rate of each topic; shaped for a Wi-Fi that ten cars share.

    A subscriber to all topics receives 1.3 Mbit/s, 0.7 of it scans; topics without subscribers are not published. 200
    is "every one", of output, distance_error and imu; of everything else the newest, at most 20 or 25 a second, because
    telemetry leaves in bursts.
    """

    output: Rate = 200.0
    """The command that went to the motor, at most so often; 0 never."""
    distance_error: Rate = 200.0
    """The follower's distance error of each scan, at most so often; 0 never."""
    decision: Rate = 10.0
    """Besides, every change of mind is sent at once."""
    status: Rate = 10.0
    """The whole state of the car, at most so often; 0 never."""
    safety: Rate = 20.0
    """What safety allows, at most so often; 0 never."""
    navigation: Rate = 20.0
    """What the follower wants, at most so often; 0 never."""
    teleop: Rate = 20.0
    """What the operator wants, at most so often; 0 never."""
    scan: Rate = 20.0
    """The lidar's scans, at most so often; 0 never."""
    odom: Rate = 20.0
    """Position and speed by the wheels, at most so often; 0 never."""
    tf: Rate = 20.0
    """The frames odom, base_link and laser, at most so often; 0 never."""
    motor: Rate = 20.0
    """The motor's speed and steering as joint states, at most so often; 0 never."""
    imu: Rate = 50.0
    """The motor controller's inertial measurements, at most so often; 0 never."""
    wall: Rate = 10.0
    """The followed wall as a drawing, at most so often; 0 never."""
    footprint: Rate = 10.0
    """The swept way as a drawing, at most so often; 0 never."""
    battery: Rate = 1.0
    """Voltage and current of the battery, at most so often; 0 never."""
    diagnostics: Rate = 1.0
    """The state of the devices for ROS tools, at most so often; 0 never."""


class TelemetryRates(Section):
    """The telemetry's own part of the [telemetry] section; the session's part is the bus's."""

    rates_hz: RatesHz = RatesHz()
