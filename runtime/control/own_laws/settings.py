"""Settings of the laws of the user: those that the car needs, and below `own` those of the law itself."""

from functools import partial
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, SerializeAsAny, ValidationInfo

from wallride.drivers.section import Section
from wallride.runtime.control.own_laws.api import LawSettings
from wallride.runtime.control.own_laws.law_class import OWN_TAG, checked_name, known_law
from wallride.runtime.host.user_class import validated

MIN_BUDGET_S, MAX_BUDGET_S = 0.0005, 0.02
LawName = Annotated[str, AfterValidator(checked_name)]
OwnValues = Annotated[SerializeAsAny[LawSettings], Field(validate_default=True)]


class UnreadSettings(LawSettings):
    """The settings of a law that this process has not imported: kept as they stood, not checked."""

    model_config = ConfigDict(extra="allow")


def own_values(section: str, value: Any, info: ValidationInfo) -> Any:  # noqa: ANN401 - whatever stood in the file
    """Return the settings of a law, validated by its own model where the law is imported."""
    name = info.data.get("method")
    if not isinstance(name, str):
        return LawSettings()  # the law's name is refused already
    law = known_law(section, name)
    model = law.model if law is not None else UnreadSettings
    if isinstance(value, model):
        return value
    return validated(model, value.model_dump() if isinstance(value, BaseModel) else value)


class OwnFollowSettings(Section):
    """A follower of the user."""

    method: LawName = OWN_TAG
    side: Literal["left", "right"] = "left"
    """Side of the followed wall."""
    desired_distance_m: Annotated[float, Field(ge=0.2, le=5)] = 1.0
    """Wanted distance from the rear axle to the wall."""
    speed_mps: Annotated[float, Field(ge=0, le=10)] = 1.0
    """Wanted speed."""
    budget_s: Annotated[float, Field(ge=MIN_BUDGET_S, le=MAX_BUDGET_S)] = 0.005
    """Time allowed for an answer; three slower ones in a row, or one of 20 times as much, stop the car."""
    expires_after_s: Annotated[float, Field(gt=0, le=0.2)] = 0.15
    """Lifetime of a navigation command, counted from its scan."""
    own: Annotated[OwnValues, BeforeValidator(partial(own_values, "wall_follow"))] = LawSettings()
