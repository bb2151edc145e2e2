"""Settings of the follower `line`."""

from typing import Annotated, Literal

from pydantic import Field

from wallride.runtime.control.wall_following.ball_settings import BallSettings


class LineFollowSettings(BallSettings):
    """The race line of a map, by the pose on it. Those of `ball` hold where the pose is not known: it drives then."""

    method: Literal["line"] = "line"
    speed_mps: Annotated[float, Field(ge=0, le=20)] = 6.0
    """Maximum speed along the line, whose own speeds are in its file."""
    wall_speed_mps: Annotated[float, Field(ge=0, le=10)] = 1.0
    """Maximum speed along the wall, while the pose is not known."""
    without_pose: Literal["wall", "stop"] = "wall"
    """Action while the pose is not known. wall: follow the wall as `ball`. stop: stop."""
    join_mps: Annotated[float, Field(gt=0, le=3)] = 1.2
    """Speed of the way to the line and of the first metre on it."""
    first_lap_share: Annotated[float, Field(gt=0.1, le=1)] = 0.6
    """Share of the line's speeds in the first lap."""
    faster_each_lap: Annotated[float, Field(ge=0, le=1)] = 0.2
    """What each lap adds to that share, up to 1, and each time that the car was held back takes away."""
    floor_mu: Annotated[float, Field(gt=0.05, le=2)] = 0.8
    """Friction that the line was planned for. Where the tyres slip as on less, its speeds are lowered."""
    cornering_front_per_rad: Annotated[float, Field(gt=0.5, le=50)] = 4.7
    """Lateral force of the front axle by its slip angle, as a multiple of friction and load (f1tenth_gym)."""
    cornering_rear_per_rad: Annotated[float, Field(gt=0.5, le=50)] = 5.5
    """The same of the rear axle."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """Lifetime of a navigation command, counted from its scan."""
