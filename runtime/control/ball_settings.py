"""What can be set about the rolling-ball follower, each number with its unit and its source."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class BallSettings(BaseModel):
    """Which wall, how far, how fast, and how the ball is steered after.

    Gains and look-ahead: a grid over tests, speeds, friction and delay is flat here. More (kp 1.0, kd 2.5, look-ahead
    0.3 + 0.3 v) comes to the wall a little sooner and suffers more from delay and noise.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    side: Literal["left", "right"] = "left"
    desired_distance_m: Annotated[float, Field(ge=0.2, le=5)] = 1.0
    """From the rear axle to the wall; narrowed to half of the free width where there is less room."""
    speed_mps: Annotated[float, Field(ge=0, le=10)] = 1.0
    """A ceiling: the speed profile goes slower where the path asks for it."""
    kp: Annotated[float, Field(ge=0, le=20)] = 0.35
    """Steering per metre of distance error [rad/m]."""
    kd: Annotated[float, Field(ge=0, le=20)] = 1.5
    """Steering per radian between the car's heading and the ball [-]."""
    look_ahead_m: Annotated[float, Field(ge=0.1, le=3)] = 0.4
    look_ahead_s: Annotated[float, Field(ge=0, le=2)] = 0.3
    """Distance from the rear axle to the ball: look_ahead_m + look_ahead_s * speed."""
    latency_s: Annotated[float, Field(ge=0, le=0.3)] = 0.05
    """From the end of a sweep to the middle of the motion that its answer causes; a late scan adds its own age."""
    trim_integral: bool = True
    """Learn the offset of a badly centred steering, slowly and only beside a straight wall."""
    speed_profile: bool = True
    """False drives `speed_mps` everywhere that there is a wall (experiments only)."""
    assumed_mu: Annotated[float, Field(gt=0.05, le=2)] = 0.5
    """Friction that the speed profile counts on: the LOW guess. 0.8 only for <= 3 m/s on a floor that was measured."""
    no_wall: Literal["slow", "search", "stop"] = "slow"
    """slow: fade the last steering. search: turn gently towards the wanted side. stop: stop."""
    no_wall_speed_mps: Annotated[float, Field(gt=0, le=1)] = 0.5
    search_at_most_m: Annotated[float, Field(gt=0, le=100)] = 12.0
    """A search without a wall for this long ends in a stop. One full turn of the search circle is 11.4 m."""
