"""What can be set about the lab report's own two laws."""

from typing import Annotated, Literal

from pydantic import Field

from runtime.section import Section


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
    kp: Annotated[float, Field(ge=0, le=20)] = 1.6
    """Steering per metre of distance error [rad/m]; 1.6 is the report's final value."""
    kd: Annotated[float, Field(ge=0, le=20)] = 1.5
    """Steering per radian of angle to the wall [-]; 1.5 is the report's final value."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """A navigation word is in force this long after its scan."""


class ReportSafetySettings(Section):
    """The report's safety rule: a fixed distance along the beam ahead."""

    method: Literal["report"] = "report"
    """The law that slows and stops: the swept footprint, or the lab report's."""
    binds_teleop: bool = False
    """True puts safety above the human: the joystick is limited too, and needs a working lidar."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """A verdict is in force this long after its scan."""
