"""Settings of every lidar, discriminated by `lidar.driver`."""

from collections.abc import Mapping
from typing import Annotated, Any, Final

from pydantic import BaseModel, Discriminator, Tag

from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.ydlidar.settings import YdlidarSettings

DEFAULT_LIDAR: Final = "hokuyo"
DRIVERS: Final[Mapping[str, tuple[type[BaseModel], ...]]] = {
    "lidar": (HokuyoSettings, RplidarSettings, YdlidarSettings)
}
"""Settings of the drivers of each kind of device that has more than one."""
DRIVER_TAGS: Final = frozenset({"hokuyo", "rplidar", "ydlidar"})


def _driver(value: Any) -> str:  # noqa: ANN401 - whatever stood in the file
    found = value.get("driver", DEFAULT_LIDAR) if isinstance(value, Mapping) else getattr(value, "driver", "")
    return str(found) or DEFAULT_LIDAR


AnyLidarSettings = HokuyoSettings | RplidarSettings | YdlidarSettings
ChosenLidar = Annotated[
    Annotated[HokuyoSettings, Tag("hokuyo")]
    | Annotated[RplidarSettings, Tag("rplidar")]
    | Annotated[YdlidarSettings, Tag("ydlidar")],
    Discriminator(_driver),
]
