"""Settings of the rolling-ball follower, each number with its unit and its source."""

from typing import Annotated, Literal

from pydantic import Field

from wallride.drivers.section import Section


class BallSettings(Section):
    """Side, distance and speed of wall following, and gains of the pursuit of the ball.

    Gains: found on the five starts at 1 to 3 m/s, clean and rough (30 mrad of trim, 40 ms more delay, 30 mm noise):
    more kp comes to the wall no sooner and overshoots with delay, less kd is late at the wall.
    """

    side: Literal["left", "right"] = "left"
    """Side of the followed wall."""
    desired_distance_m: Annotated[float, Field(ge=0.2, le=5)] = 1.0
    """Wanted distance from the rear axle to the wall; at most half of the free width."""
    speed_mps: Annotated[float, Field(ge=0, le=10)] = 1.0
    """Maximum speed; the speed profile is slower in bends and narrow places."""
    kp: Annotated[float, Field(ge=0, le=20)] = 13.5
    """Gain of the distance error near the wanted distance at 1 m/s [rad/m]; falls as 1 / speed^2."""
    kd: Annotated[float, Field(ge=0, le=20)] = 4.5
    """Gain of the heading error at 1 m/s [-]; falls as 1 / speed."""
    look_ahead_m: Annotated[float, Field(ge=0.1, le=3)] = 0.4
    """Distance from the rear axle to the ball at standstill, far from the path."""
    look_ahead_s: Annotated[float, Field(ge=0, le=2)] = 0.3
    """Growth with speed of the distance to the ball: look_ahead_m + look_ahead_s * speed."""
    latency_s: Annotated[float, Field(ge=0, le=0.3)] = 0.03
    """Delay from the motor command to the middle of the motion that it causes: dead time of the servo and half a scan.
    The delay before the command is measured and added."""
    trim_integral: bool = True
    """Estimate and correct the steering offset while driving along a straight wall."""
    speed_profile: bool = True
    """Slow down for bends and narrow places; false drives `speed_mps` along every wall (experiments only)."""
    assumed_mu: Annotated[float, Field(gt=0.05, le=2)] = 0.65
    """Friction assumed by the speed profile; choose it low. With 0.65 the car drives a floor of 0.5 without contact at
    up to 4 m/s, up to 0.5 m too wide in corners; use 0.8 only on a floor that was measured."""
    no_wall: Literal["slow", "search", "stop"] = "slow"
    """Action without a wall. slow: straighten the steering. search: turn gently to the followed side. stop: stop."""
    no_wall_speed_mps: Annotated[float, Field(gt=0, le=1)] = 0.5
    """Maximum speed while no wall is seen."""
    search_at_most_m: Annotated[float, Field(gt=0, le=100)] = 12.0
    """Maximum way of a search; then the car stops. One turn of the search circle is 11.4 m."""
