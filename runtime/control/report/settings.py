"""Settings of the lab report's own two laws."""

from typing import Annotated, Literal

from pydantic import Field

from runtime.settings_base import Section


class ReportFollowSettings(Section):
    """The report's wall follower: side, distance, speed and gains."""

    method: Literal["report"] = "report"
    """Wall-following law: the rolling ball, or the lab report's."""
    side: Literal["left", "right"] = "left"
    """Side of the followed wall."""
    desired_distance_m: Annotated[float, Field(ge=0.2, le=5)] = 1.0
    """Wanted distance from the rear axle to the wall."""
    speed_mps: Annotated[float, Field(ge=0, le=10)] = 1.0
    """Speed; constant."""
    kp: Annotated[float, Field(ge=0, le=20)] = 1.5
    """Gain of the distance error [rad/m]; 1.5 is the report's final value."""
    kd: Annotated[float, Field(ge=0, le=20)] = 1.6
    """Gain of the angle to the wall [-]; 1.6 is the report's final value."""
    corner_ahead_m: Annotated[float, Field(ge=0, le=10)] = 2.0
    """Maximum distance ahead of a corner; half of the distance ahead is then the distance to the wall. 0: off."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """Lifetime of a navigation command, counted from its scan."""


class ReportSafetySettings(Section):
    """The report's two safety rules, both along the beam ahead: a stop at a fixed distance, and before it a turn."""

    method: Literal["report"] = "report"
    """Safety law: the swept footprint, or the lab report's."""
    turn_below_m: Annotated[float, Field(ge=0, le=10)] = 1.5
    """Distance to an obstacle ahead below which the car steers fully away from the followed wall. 0: off; the stop at
    the turning radius stays."""
    binds_teleop: bool = False
    """Safety limits manual driving as well; it then needs a working lidar."""
    odometry_check: bool = True
    """Compare wheel odometry with the scans over the first 0.3 m; false where they are not from one drive."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """Lifetime of a speed limit, counted from its scan."""
