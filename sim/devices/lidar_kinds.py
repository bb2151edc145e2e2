"""Emulated lidars by the words of the command line."""

from collections.abc import Mapping
from typing import Final

from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.runtime.own_drivers.driver_class import is_own
from wallride.runtime.settings.devices import AnyLidarSettings
from wallride.sim.devices.own import OwnLidarEmulator, emulator_of
from wallride.sim.devices.rplidar import A1, A2, A3, C1, S1, S2, S3, RplidarDevice, RplidarModel
from wallride.sim.devices.turning import TurningDevice
from wallride.sim.devices.ydlidar import G4, G6, TG, X2, X4, X4_PRO, YdlidarDevice, YdlidarModel

HOKUYO: Final = "hokuyo"
_ALL: Final = (A1, A2, A3, C1, S1, S2, S3, X4, X2, X4_PRO, G4, G6, TG)
_MODELS: Final[Mapping[str, RplidarModel | YdlidarModel]] = {
    "rplidar": A1, "ydlidar": X4, **{model.name.lower(): model for model in _ALL},
}  # fmt: skip


def device_for(word: str) -> TurningDevice | OwnLidarEmulator | None:
    """As `emulated`, also of a driver of the user; UserCodeError where that has no emulator."""
    return OwnLidarEmulator(emulator_of("lidar", word)) if is_own("lidar", word) else emulated(word)


def emulated(word: str) -> TurningDevice | None:
    """Return the lidar of a word of the command line, None for the Hokuyo, which has an emulator of its own."""
    if word == HOKUYO:
        return None
    model = _MODELS[word]
    return RplidarDevice(model) if isinstance(model, RplidarModel) else YdlidarDevice(model)


def word_of(settings: AnyLidarSettings) -> str:
    """Return the word of the lidar that the settings name, its driver's where no word is nearer."""
    if isinstance(settings, YdlidarSettings) and settings.model in _MODELS:
        return settings.model
    return settings.driver


def assignments(word: str) -> list[str]:
    """Return the settings that name the driver of a word, and the model where the sensor does not tell it."""
    if word == HOKUYO:
        return [f"lidar.driver={HOKUYO}"]
    model = _MODELS[word]
    if isinstance(model, RplidarModel):
        return ["lidar.driver=rplidar"]
    return ["lidar.driver=ydlidar", *([f"lidar.model={word}"] if model.one_way else [])]
