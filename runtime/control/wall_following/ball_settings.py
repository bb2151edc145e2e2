"""Settings of the rolling-ball follower, each number with its unit and its source."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class BallSettings(BaseModel):
    """Which wall, how far, how fast, and how the ball is steered after.

    Gains: found on the five starts at 1 to 3 m/s, clean and rough (30 mrad of trim, 40 ms more delay, 30 mm noise):
    more kp comes to the wall no sooner and overshoots with delay, less kd is late at the wall.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    side: Literal["left", "right"] = "left"
    """Which wall is followed."""
    desired_distance_m: Annotated[float, Field(ge=0.2, le=5)] = 1.0
    """From the rear axle to the wall; narrowed to half of the free width where there is less room."""
    speed_mps: Annotated[float, Field(ge=0, le=10)] = 1.0
    """A ceiling: the speed profile goes slower where the path asks for it."""
    kp: Annotated[float, Field(ge=0, le=20)] = 13.5
    """Steering per metre of distance error, near the wanted distance at 1 m/s [rad/m]; falls as 1 / speed^2."""
    kd: Annotated[float, Field(ge=0, le=20)] = 4.5
    """Steering per radian between the car's heading and the wanted one at 1 m/s [-]; falls as 1 / speed."""
    look_ahead_m: Annotated[float, Field(ge=0.1, le=3)] = 0.4
    """The part of the distance from the rear axle to the ball that does not depend on the speed."""
    look_ahead_s: Annotated[float, Field(ge=0, le=2)] = 0.3
    """Distance from the rear axle to the ball: look_ahead_m + look_ahead_s * speed."""
    latency_s: Annotated[float, Field(ge=0, le=0.3)] = 0.03
    """From the answer on the motor's wire to the middle of the motion that it causes: the servo's dead time and half a
    scan. The way to the wire is measured; a late scan adds its own age."""
    trim_integral: bool = True
    """Learn the offset of a badly centred steering, from how the car turns beside a straight wall."""
    speed_profile: bool = True
    """False drives `speed_mps` everywhere that there is a wall (experiments only)."""
    assumed_mu: Annotated[float, Field(gt=0.05, le=2)] = 0.65
    """Friction that the speed profile counts on: a LOW guess. With 0.65 a floor of 0.5 is driven without contact at up
    to 4 m/s, in corners up to 0.5 m wide of the wall; 0.8 only on a floor that was measured."""
    no_wall: Literal["slow", "search", "stop"] = "slow"
    """slow: fade the last steering. search: turn gently towards the wanted side. stop: stop."""
    no_wall_speed_mps: Annotated[float, Field(gt=0, le=1)] = 0.5
    """The fastest while no wall is seen."""
    search_at_most_m: Annotated[float, Field(gt=0, le=100)] = 12.0
    """A search without a wall for this long ends in a stop. One full turn of the search circle is 11.4 m."""
