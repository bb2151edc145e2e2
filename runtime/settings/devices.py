"""Settings of every lidar and every motor controller, discriminated by `lidar.driver` and `motor.driver`."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, Discriminator, Field, Tag, field_validator

from wallride.drivers.address import parse_address
from wallride.drivers.auto.settings import AutoLidarSettings
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.section import Section
from wallride.drivers.vesc.settings import VescSettings
from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.runtime.host.user_class import OWN_TAG
from wallride.runtime.own_drivers.driver_class import is_own
from wallride.runtime.own_drivers.settings import OwnLidarSettings, OwnMotorSettings
from wallride.runtime.ros.graph import PUBLISHED


class TopicLidarSettings(Section):
    """Scans as sensor_msgs/LaserScan over zenoh, from ROS 2 through rmw_zenoh."""

    driver: Literal["topic"] = "topic"
    """Type of the lidar."""
    topic: Annotated[
        str,
        Field(
            pattern=r"^[a-z][a-z0-9_]*(/[a-z][a-z0-9_]*)*$", description="Name of the topic, without a slash in front."
        ),
    ] = "lidar/scan"
    stale_after_s: Annotated[
        float, Field(gt=0, le=1, description="Maximum age of a scan by its stamp; a later one is dropped.")
    ] = 0.1
    degraded_after_s: Annotated[
        float, Field(gt=0, le=2, description="Time without a scan after which the lidar is not ready.")
    ] = 0.5

    @field_validator("topic")
    @classmethod
    def _is_not_the_cars_own(cls, name: str) -> str:
        if name in {topic.name for topic in PUBLISHED.values()}:
            raise ValueError(f"the car itself publishes /{name}: have the lidar's driver publish under another name")
        return name


DEFAULT_DRIVERS: Final[Mapping[str, str]] = {"lidar": "hokuyo", "motor": "vesc"}
DRIVERS: Final[Mapping[str, tuple[type[BaseModel], ...]]] = {
    "lidar": (HokuyoSettings, RplidarSettings, YdlidarSettings, AutoLidarSettings, TopicLidarSettings),
    "motor": (VescSettings, MaestroSettings, Pca9685Settings),
}
"""Settings of the built-in drivers of each kind of device."""
OWN_DRIVERS: Final[Mapping[str, type[BaseModel]]] = {"lidar": OwnLidarSettings, "motor": OwnMotorSettings}
"""Settings of the user's own drivers, beside the built-in ones."""
DRIVER_TAGS: Final = frozenset({"hokuyo", "rplidar", "ydlidar", "auto", "topic", "vesc", "maestro", "pca9685", OWN_TAG})


def _driver(section: str) -> Discriminator:
    default = DEFAULT_DRIVERS[section]

    def tell(value: Any) -> str:  # noqa: ANN401 - whatever stood in the file
        found = value.get("driver", default) if isinstance(value, Mapping) else getattr(value, "driver", "")
        name = str(found) or default
        return OWN_TAG if name not in DRIVER_TAGS and is_own(section, name) else name

    return Discriminator(tell)


AnyLidarSettings = (
    HokuyoSettings | RplidarSettings | YdlidarSettings | AutoLidarSettings | TopicLidarSettings | OwnLidarSettings
)
AnyMotorSettings = VescSettings | MaestroSettings | Pca9685Settings | OwnMotorSettings
ChosenLidar = Annotated[
    Annotated[HokuyoSettings, Tag("hokuyo")]
    | Annotated[RplidarSettings, Tag("rplidar")]
    | Annotated[YdlidarSettings, Tag("ydlidar")]
    | Annotated[AutoLidarSettings, Tag("auto")]
    | Annotated[TopicLidarSettings, Tag("topic")]
    | Annotated[OwnLidarSettings, Tag(OWN_TAG)],
    _driver("lidar"),
]
ChosenMotor = Annotated[
    Annotated[VescSettings, Tag("vesc")]
    | Annotated[MaestroSettings, Tag("maestro")]
    | Annotated[Pca9685Settings, Tag("pca9685")]
    | Annotated[OwnMotorSettings, Tag(OWN_TAG)],
    _driver("motor"),
]


def share_an_address(lidar: AnyLidarSettings, motor: AnyMotorSettings) -> bool:
    """Tell whether lidar and motor are at one address; those of own drivers are their own affair."""
    texts = [text for name, text in addresses(lidar, motor) if ".own." not in name and text]
    places = {str(parse_address(text)).partition("?")[0] for text in texts}
    return len(places) < len(texts)


def addresses(lidar: AnyLidarSettings, motor: AnyMotorSettings) -> Iterator[tuple[str, str]]:
    """Yield the name of each setting that is the address of a device, and its text."""
    for section, settings in (("lidar", lidar), ("motor", motor)):
        own = getattr(settings, "own", None)
        text = getattr(settings if own is None else own, "address", None)
        if isinstance(text, str):
            yield f"{section}.address" if own is None else f"{section}.own.address", text
