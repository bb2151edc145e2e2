"""What leaves the car over zenoh, and how often."""

from typing import Annotated

from pydantic import Field

from runtime.section import Section

Rate = Annotated[float, Field(ge=0, le=200)]
"""At most so many a second; 0 never. A topic is never sent more often than there is news."""


class RatesHz(Section):
    """How often each topic goes out at most; shaped for a Wi-Fi that ten cars share.

    Who hears everything takes 1.3 Mbit/s, 0.7 of it for the scans; what nobody hears takes nothing.
    200 is "every one", of output, distance_error and imu; of everything else the newest, at most 20 or 25 a second,
    because telemetry leaves in bursts.
    """

    output: Rate = 200.0
    distance_error: Rate = 200.0
    decision: Rate = 10.0
    """Besides, every change of mind is sent at once."""
    status: Rate = 10.0
    safety: Rate = 20.0
    navigation: Rate = 20.0
    teleop: Rate = 20.0
    scan: Rate = 20.0
    odom: Rate = 20.0
    tf: Rate = 20.0
    motor: Rate = 20.0
    imu: Rate = 50.0
    wall: Rate = 10.0
    footprint: Rate = 10.0
    battery: Rate = 1.0
    diagnostics: Rate = 1.0


class TelemetryRates(Section):
    """The telemetry's own part of the [telemetry] section; the session's part is the bus's."""

    rates_hz: RatesHz = RatesHz()
