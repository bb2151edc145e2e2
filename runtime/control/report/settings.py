"""Settings of the lab report's own two laws."""

from typing import Annotated, Literal

from pydantic import Field

from wallride.drivers.section import Section


class ReportFollowSettings(Section):
    """The lab report's follower."""

    method: Literal["report"] = "report"
    side: Literal["left", "right"] = "left"
    """Side of the followed wall."""
    desired_distance_m: Annotated[float, Field(ge=0.2, le=5)] = 1.0
    """Wanted distance from the lidar to the wall."""
    speed_mps: Annotated[float, Field(ge=0, le=10)] = 1.0
    """Speed; constant."""
    kp: Annotated[float, Field(ge=0, le=20)] = 1.5
    """Gain of the distance error [rad/m]; 1.5 is the report's final value."""
    kd: Annotated[float, Field(ge=0, le=20)] = 1.6
    """Gain of the angle to the wall [-]; 1.6 is the report's final value."""
    distance: Literal["three_smallest", "line", "intercept"] = "three_smallest"
    """Distance to the wall: mean of the three smallest ranges (the report's), perpendicular to the fitted line, or
    where the line crosses the lidar's left-right axis."""
    corner_rule: Literal["lab3", "lab2"] = "lab3"
    """Corner rule of Lab 3: a range ahead up to corner_ahead_m counts half as the distance to the wall. Of Lab 2: one
    up to nearest range x speed_mps counts divided by speed_mps."""
    corner_ahead_m: Annotated[float, Field(ge=0, le=10)] = 2.0
    """Maximum range ahead of a corner under the rule of Lab 3. 0: no corner rule, of either lab."""
    by_the_letter: bool = False
    """Side sector from straight ahead on, as the report's text has it, and one beam as the range ahead, as its code has
    it; false: the sector begins at 18 degrees, and ahead is the mean of the three nearest within half a degree."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """Lifetime of a navigation command, counted from its scan."""


class ReportSafetySettings(Section):
    """The lab report's two rules, both along the beam ahead: a stop at a fixed distance, and before it a turn."""

    method: Literal["report"] = "report"
    turn_below_m: Annotated[float, Field(ge=0, le=10)] = 1.5
    """Distance to an obstacle ahead below which the car steers fully away from the followed wall. 0: off; the stop at
    the turning radius stays."""
    by_the_letter: bool = False
    """One unfiltered beam as the range ahead, and the turn has speed 0, because the report's message leaves its speed
    unset; false: the filtered mean of the three nearest ahead, and the turn is driven at the follower's speed."""
    binds_teleop: bool = False
    """Safety limits manual driving as well; it then needs a working lidar."""
    odometry_check: bool = True
    """Compare wheel odometry with the scans over the first 0.3 m; false where they are not from one drive."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """Lifetime of a speed limit, counted from its scan."""
