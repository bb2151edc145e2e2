"""Emulated lidars by the words of the command line."""

from collections.abc import Callable
from typing import Final

from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.runtime.own_drivers.driver_class import is_own
from wallride.runtime.settings.devices import AnyLidarSettings
from wallride.sim.devices import rplidar, ydlidar
from wallride.sim.devices.own import OwnLidarEmulator, emulator_of
from wallride.sim.devices.turning import TurningDevice

HOKUYO: Final = "hokuyo"
_DEVICES: Final[dict[str, tuple[str, Callable[[], TurningDevice]]]] = {
    "rplidar": ("rplidar", lambda: rplidar.RplidarDevice(rplidar.A1)),
    "ydlidar": ("ydlidar", lambda: ydlidar.YdlidarDevice(ydlidar.X4)),
    "a1": ("rplidar", lambda: rplidar.RplidarDevice(rplidar.A1)),
    "a2": ("rplidar", lambda: rplidar.RplidarDevice(rplidar.A2)),
    "c1": ("rplidar", lambda: rplidar.RplidarDevice(rplidar.C1)),
    "s2": ("rplidar", lambda: rplidar.RplidarDevice(rplidar.S2)),
    "x4": ("ydlidar", lambda: ydlidar.YdlidarDevice(ydlidar.X4)),
    "x2": ("ydlidar", lambda: ydlidar.YdlidarDevice(ydlidar.X2)),
    "g4": ("ydlidar", lambda: ydlidar.YdlidarDevice(ydlidar.G4)),
}


def device_for(word: str) -> TurningDevice | OwnLidarEmulator | None:
    """As `emulated`, also of a driver of the user; UserCodeError where that has no emulator."""
    return OwnLidarEmulator(emulator_of("lidar", word)) if is_own("lidar", word) else emulated(word)


def emulated(word: str) -> TurningDevice | None:
    """Return the lidar of a word of KINDS, None for the Hokuyo, which has an emulator of its own."""
    return None if word == HOKUYO else _DEVICES[word][1]()


def word_of(settings: AnyLidarSettings) -> str:
    """Return the word of the lidar that the settings name, its driver's where no word is nearer."""
    return "x2" if isinstance(settings, YdlidarSettings) and settings.model == "x2" else settings.driver


def assignments(word: str) -> list[str]:
    """Return the settings that name the driver of a word of KINDS."""
    driver = HOKUYO if word == HOKUYO else _DEVICES[word][0]
    return [f"lidar.driver={driver}", *(["lidar.model=x2"] if word == "x2" else [])]
