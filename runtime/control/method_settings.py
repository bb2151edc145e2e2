"""Settings of every law, discriminated by `wall_follow.method` and `safety.method`."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Discriminator, Field, Tag

from runtime.control.perception.lidar_health_settings import LidarHealthSettings
from runtime.control.report.settings import ReportFollowSettings, ReportSafetySettings
from runtime.control.safety.swept_settings import RecoverySettings, SweptSettings
from runtime.control.wall_following.ball_settings import BallSettings

DEFAULT_FOLLOW = "ball"
DEFAULT_SAFETY = "swept"


class BallFollowSettings(BallSettings):
    """The rolling ball: the default follower."""

    method: Literal["ball"] = "ball"
    """Wall-following law: the rolling ball, or the lab report's."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """Lifetime of a navigation command, counted from its scan."""


class SweptSafetySettings(SweptSettings):
    """The swept footprint: the default safety."""

    method: Literal["swept"] = "swept"
    """Safety law: the swept footprint, or the lab report's."""
    binds_teleop: bool = False
    """Safety limits manual driving as well; it then needs a working lidar."""
    odometry_check: bool = True
    """Compare wheel odometry with the scans over the first 0.3 m; false where they are not from one drive."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """Lifetime of a speed limit, counted from its scan."""
    backs_out: bool = True
    """Back out of a dead end and try another way; false: wait for a human."""
    recovery: RecoverySettings = RecoverySettings()
    window: LidarHealthSettings = LidarHealthSettings()


def _method(default: str) -> Discriminator:
    def tell(value: Any) -> str:  # noqa: ANN401 - whatever stood in the file
        found = value.get("method", default) if isinstance(value, Mapping) else getattr(value, "method", default)
        return str(found)

    return Discriminator(tell)


WallFollowSettings = BallFollowSettings | ReportFollowSettings
SafetySettings = SweptSafetySettings | ReportSafetySettings
ChosenWallFollow = Annotated[
    Annotated[BallFollowSettings, Tag("ball")] | Annotated[ReportFollowSettings, Tag("report")], _method(DEFAULT_FOLLOW)
]
ChosenSafety = Annotated[
    Annotated[SweptSafetySettings, Tag("swept")] | Annotated[ReportSafetySettings, Tag("report")],
    _method(DEFAULT_SAFETY),
]
METHODS: Mapping[str, tuple[type[BaseModel], ...]] = {
    "wall_follow": (BallFollowSettings, ReportFollowSettings),
    "safety": (SweptSafetySettings, ReportSafetySettings),
}
TAGS = frozenset({"ball", "swept", "report"})

KEPT_BY_NEW_METHOD = frozenset({"side", "desired_distance_m", "speed_mps", "expires_after_s", "binds_teleop"})
"""Settings with the same meaning in every law; gains and margins of one law do not transfer to another."""
