"""Settings of the follower `corridor`."""

from typing import Annotated, Literal

from pydantic import Field

from wallride.runtime.control.wall_following.ball_settings import BallSettings


class CorridorFollowSettings(BallSettings):
    """A fast way between both borders of the course, without a map. Those of `ball` hold where there is none."""

    method: Literal["corridor"] = "corridor"
    cornering_front_per_rad: Annotated[float, Field(gt=0.5, le=50)] = 4.7
    """Lateral force of the front axle by its slip angle, as a multiple of friction and load (f1tenth_gym)."""
    cornering_rear_per_rad: Annotated[float, Field(gt=0.5, le=50)] = 5.5
    """The same of the rear axle."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """Lifetime of a navigation command, counted from its scan."""
