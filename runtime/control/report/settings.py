"""Settings of the lab report's own two laws."""

from typing import Annotated, Literal

from pydantic import Field

from runtime.settings_base import Section


class ReportFollowSettings(Section):
    """The report's wall follower: which wall, how far, how fast."""

    method: Literal["report"] = "report"
    """The law that follows the wall: the rolling ball, or the lab report's."""
    side: Literal["left", "right"] = "left"
    """Which wall is followed."""
    desired_distance_m: Annotated[float, Field(ge=0.2, le=5)] = 1.0
    """From the rear axle to the wall."""
    speed_mps: Annotated[float, Field(ge=0, le=10)] = 1.0
    """The speed of the whole drive."""
    kp: Annotated[float, Field(ge=0, le=20)] = 1.5
    """Steering per metre of distance error [rad/m]; 1.5 is the report's final value."""
    kd: Annotated[float, Field(ge=0, le=20)] = 1.6
    """Steering per radian of angle to the wall [-]; 1.6 is the report's final value."""
    corner_ahead_m: Annotated[float, Field(ge=0, le=10)] = 2.0
    """Lab 2's corner rule: what is ahead at this distance or nearer is a corner, and half of it the distance to the
    wall. 0 switches the rule off."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """A navigation word is in force this long after its scan."""


class ReportSafetySettings(Section):
    """The report's two safety rules, both along the beam ahead: a stop at a fixed distance, and before it a turn."""

    method: Literal["report"] = "report"
    """The law that slows and stops: the swept footprint, or the lab report's."""
    turn_below_m: Annotated[float, Field(ge=0, le=10)] = 1.5
    """The second rule: an obstacle nearer than this ahead forces full steering away from the followed wall. 0 switches
    the rule off; the stop at the turning radius stays."""
    binds_teleop: bool = False
    """True puts safety above the human: the joystick is limited too, and needs a working lidar."""
    odometry_check: bool = True
    """Compare the wheels' way with the scans' over the first 0.3 m; false where they are not of one drive."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """A verdict is in force this long after its scan."""
