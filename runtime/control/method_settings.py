"""Settings of every law, discriminated by `wall_follow.method` and `safety.method`.

A law of wallride is entered once, in `WallFollowSettings` or `SafetySettings`; its name is the default of `method`, and
the first sentence of its settings says what it is.
"""

import operator
from collections.abc import Mapping
from functools import partial, reduce
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, get_args

from pydantic import BaseModel, BeforeValidator, Discriminator, Field, Tag

from wallride.runtime.control.corridor_following.corridor_settings import CorridorFollowSettings
from wallride.runtime.control.line_following.line_settings import LineFollowSettings
from wallride.runtime.control.own_laws.api import LawSettings
from wallride.runtime.control.own_laws.law_class import OWN_TAG, is_own
from wallride.runtime.control.own_laws.settings import (
    MAX_BUDGET_S,
    MIN_BUDGET_S,
    LawName,
    OwnFollowSettings,
    OwnValues,
    own_values,
)
from wallride.runtime.control.perception.lidar_health_settings import LidarHealthSettings
from wallride.runtime.control.report.settings import ReportFollowSettings, ReportSafetySettings
from wallride.runtime.control.safety.swept_settings import RecoverySettings, SweptSettings
from wallride.runtime.control.wall_following.ball_settings import BallSettings

DEFAULT_FOLLOW = "ball"
DEFAULT_SAFETY = "swept"


class BallFollowSettings(BallSettings):
    """The rolling ball, the default."""

    method: Literal["ball"] = "ball"
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """Lifetime of a navigation command, counted from its scan."""


class SweptSafetySettings(SweptSettings):
    """The swept footprint, the default."""

    method: Literal["swept"] = "swept"
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

    method: LawName = OWN_TAG  # type: ignore[assignment] # another name in place of the one literal
    budget_s: Annotated[float, Field(ge=MIN_BUDGET_S, le=MAX_BUDGET_S)] = 0.005
    """Time allowed for an answer; three slower ones in a row, or one of 20 times as much, stop the car."""
    own: Annotated[OwnValues, BeforeValidator(partial(own_values, "safety"))] = LawSettings()


def _method(default: str) -> Discriminator:
    def tell(value: Any) -> str:  # noqa: ANN401 - whatever stood in the file
        found = value.get("method", default) if isinstance(value, Mapping) else getattr(value, "method", default)
        return OWN_TAG if is_own(str(found)) else str(found)

    return Discriminator(tell)


WallFollowSettings = (
    BallFollowSettings | ReportFollowSettings | LineFollowSettings | CorridorFollowSettings | OwnFollowSettings
)
SafetySettings = SweptSafetySettings | ReportSafetySettings | OwnSafetySettings
OWN_METHODS: Final[Mapping[str, type[BaseModel]]] = {"wall_follow": OwnFollowSettings, "safety": OwnSafetySettings}
"""Settings of the user's own laws, beside the built-in ones."""
METHODS: Final[Mapping[str, tuple[type[BaseModel], ...]]] = {
    section: tuple(law for law in get_args(laws) if law is not OWN_METHODS[section])
    for section, laws in (("wall_follow", WallFollowSettings), ("safety", SafetySettings))
}
"""Settings of the built-in laws of each section."""


def name_of(law: type[BaseModel]) -> str:
    """Return the name by which `method` selects a law, from its settings; that of the user's laws is OWN_TAG."""
    return str(law.model_fields["method"].default)


if TYPE_CHECKING:
    ChosenWallFollow = WallFollowSettings
    ChosenSafety = SafetySettings
else:

    def _chosen(section: str, default: str) -> object:
        """Return the union of a section's laws, of which `method` selects one."""
        laws = (*METHODS[section], OWN_METHODS[section])
        tagged = (Annotated[law, Tag(name_of(law))] for law in laws)
        return Annotated[reduce(operator.or_, tagged), _method(default)]

    ChosenWallFollow = _chosen("wall_follow", DEFAULT_FOLLOW)
    ChosenSafety = _chosen("safety", DEFAULT_SAFETY)

TAGS: Final = frozenset({OWN_TAG, *(name_of(law) for laws in METHODS.values() for law in laws)})

_KEPT = frozenset({"side", "desired_distance_m", "speed_mps", "expires_after_s", "binds_teleop"})
"""Settings with the same meaning in every law; gains and margins of one law do not transfer to another."""
_OF_SWEPT = frozenset(SweptSafetySettings.model_fields) - {"method"}


def kept_by_new_method(section: str, old: object, new: object) -> frozenset[str]:
    """Return the settings of a section that another method keeps.

    A safety law of the user stands beside `swept`, whose settings stay as they are.
    """
    beside_swept = section == "safety" and all(method == DEFAULT_SAFETY or is_own(str(method)) for method in (old, new))
    return _KEPT | _OF_SWEPT if beside_swept else _KEPT
