"""Settings of every law, discriminated by `wall_follow.method` and `safety.method`."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Discriminator, Field, SerializeAsAny, Tag, ValidationInfo, field_validator

from wallride.runtime.control.corridor_following.corridor_settings import CorridorFollowSettings
from wallride.runtime.control.line_following.line_settings import LineFollowSettings
from wallride.runtime.control.own_laws.api import LawSettings
from wallride.runtime.control.own_laws.law_class import OWN_TAG, checked_name, is_own
from wallride.runtime.control.own_laws.settings import MAX_BUDGET_S, MIN_BUDGET_S, OwnFollowSettings, own_values
from wallride.runtime.control.perception.lidar_health_settings import LidarHealthSettings
from wallride.runtime.control.report.settings import ReportFollowSettings, ReportSafetySettings
from wallride.runtime.control.safety.swept_settings import RecoverySettings, SweptSettings
from wallride.runtime.control.wall_following.ball_settings import BallSettings

DEFAULT_FOLLOW = "ball"
DEFAULT_SAFETY = "swept"


class BallFollowSettings(BallSettings):
    """The rolling ball: the default follower."""

    method: Literal["ball"] = "ball"
    """Wall-following law: the rolling ball, the lab report's, the race line of a map, or a way between both borders."""
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


class OwnSafetySettings(SweptSafetySettings):
    """A safety law of the user, beside the swept footprint: of both limits the lower one holds."""

    method: str = OWN_TAG  # type: ignore[assignment] # another name in place of the one literal
    """Safety law: `swept`, `report`, or MODULE:CLASS of your own beside `swept`."""
    budget_s: Annotated[float, Field(ge=MIN_BUDGET_S, le=MAX_BUDGET_S)] = 0.005
    """Time allowed for an answer; three slower ones in a row, or one of 20 times as much, stop the car."""
    own: Annotated[SerializeAsAny[LawSettings], Field(validate_default=True)] = LawSettings()

    @field_validator("method")
    @classmethod
    def _loads(cls, method: str) -> str:
        return checked_name(method)

    @field_validator("own", mode="before")
    @classmethod
    def _own(cls, value: Any, info: ValidationInfo) -> Any:  # noqa: ANN401 - whatever stood in the file
        return own_values("safety", value, info)


def _method(default: str) -> Discriminator:
    def tell(value: Any) -> str:  # noqa: ANN401 - whatever stood in the file
        found = value.get("method", default) if isinstance(value, Mapping) else getattr(value, "method", default)
        return OWN_TAG if is_own(str(found)) else str(found)

    return Discriminator(tell)


WallFollowSettings = (
    BallFollowSettings | ReportFollowSettings | LineFollowSettings | CorridorFollowSettings | OwnFollowSettings
)
SafetySettings = SweptSafetySettings | ReportSafetySettings | OwnSafetySettings
ChosenWallFollow = Annotated[
    Annotated[BallFollowSettings, Tag("ball")]
    | Annotated[ReportFollowSettings, Tag("report")]
    | Annotated[LineFollowSettings, Tag("line")]
    | Annotated[CorridorFollowSettings, Tag("corridor")]
    | Annotated[OwnFollowSettings, Tag(OWN_TAG)],
    _method(DEFAULT_FOLLOW),
]
ChosenSafety = Annotated[
    Annotated[SweptSafetySettings, Tag("swept")]
    | Annotated[ReportSafetySettings, Tag("report")]
    | Annotated[OwnSafetySettings, Tag(OWN_TAG)],
    _method(DEFAULT_SAFETY),
]
METHODS: Mapping[str, tuple[type[BaseModel], ...]] = {
    "wall_follow": (BallFollowSettings, ReportFollowSettings, LineFollowSettings, CorridorFollowSettings),
    "safety": (SweptSafetySettings, ReportSafetySettings),
}
OWN_METHODS: Mapping[str, type[BaseModel]] = {"wall_follow": OwnFollowSettings, "safety": OwnSafetySettings}
"""Settings of the user's own laws, beside the built-in ones."""
TAGS = frozenset(
    {OWN_TAG, *(str(each.model_fields["method"].default) for section in METHODS.values() for each in section)}
)

_KEPT = frozenset({"side", "desired_distance_m", "speed_mps", "expires_after_s", "binds_teleop"})
"""Settings with the same meaning in every law; gains and margins of one law do not transfer to another."""
_OF_SWEPT = frozenset(SweptSafetySettings.model_fields) - {"method"}


def kept_by_new_method(section: str, old: object, new: object) -> frozenset[str]:
    """Return the settings of a section that another method keeps.

    A safety law of the user stands beside `swept`, whose settings stay as they are.
    """
    beside_swept = section == "safety" and all(method == DEFAULT_SAFETY or is_own(str(method)) for method in (old, new))
    return _KEPT | _OF_SWEPT if beside_swept else _KEPT
