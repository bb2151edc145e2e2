"""Settings of the drivers of the user: those that the car needs, and below `own` those of the driver itself."""

from functools import partial
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, SerializeAsAny, ValidationInfo

from wallride.drivers.own import DriverSettings
from wallride.drivers.section import Section
from wallride.runtime.host.user_class import OWN_TAG, validated
from wallride.runtime.own_drivers.driver_class import checked_name, known_driver

OwnValues = Annotated[SerializeAsAny[DriverSettings], Field(validate_default=True)]


class UnreadDriverSettings(DriverSettings):
    """The settings of a driver that this process has not imported: kept as they stood, not checked."""

    model_config = ConfigDict(extra="allow")


def _own_values(section: str, value: Any, info: ValidationInfo) -> Any:  # noqa: ANN401 - whatever stood in the file
    """Return the settings of a driver, validated by its own model where the driver is imported."""
    name = info.data.get("driver")
    if not isinstance(name, str):
        return DriverSettings()  # the driver's name is refused already
    driver = known_driver(section, name)
    model = driver.model if driver is not None else UnreadDriverSettings
    if isinstance(value, model):
        return value
    return validated(model, value.model_dump() if isinstance(value, BaseModel) else value)


class OwnLidarSettings(Section):
    """A lidar whose driver is the user's."""

    driver: Annotated[str, AfterValidator(partial(checked_name, "lidar"))] = OWN_TAG
    """Driver of the lidar: a built-in one, MODULE:CLASS of your own, or the name that an installed package gives."""
    stale_after_s: Annotated[float, Field(gt=0, le=1)] = 0.1
    """Maximum age of a delivered scan; an older one is dropped."""
    degraded_after_s: Annotated[float, Field(gt=0, le=2)] = 0.5
    """Time without a scan after which the lidar is not ready."""
    own: Annotated[OwnValues, BeforeValidator(partial(_own_values, "lidar"))] = DriverSettings()


class OwnMotorSettings(Section):
    """A motor controller whose driver is the user's."""

    driver: Annotated[str, AfterValidator(partial(checked_name, "motor"))] = OWN_TAG
    """Driver of the motor: `vesc`, MODULE:CLASS of your own, or the name that an installed package gives."""
    min_speed_mps: Annotated[float, Field(ge=0.05, le=1)] = 0.2
    """Minimum speed that the motor holds; slower is a stop."""
    lost_after_s: Annotated[float, Field(ge=0.05, le=5)] = 0.2
    """Maximum age of the motor's newest report; then the motor counts as lost."""
    own: Annotated[OwnValues, BeforeValidator(partial(_own_values, "motor"))] = DriverSettings()
