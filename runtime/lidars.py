"""The driver of the lidar that the settings name."""

import math
import time
from collections.abc import Callable

from wallride.drivers.api import Clock, MotorState, Reschedule, as_wanted
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.rplidar.driver import Rplidar
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.turning.driver import TurningLidar
from wallride.drivers.turning.grid import STILL, AskMotion, Motion, standing
from wallride.drivers.ydlidar.driver import Ydlidar
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.settings.devices import AnyLidarSettings


def lidar_for(
    settings: AnyLidarSettings,
    *,
    clock: Clock = time.monotonic,
    clear_s: Reschedule = as_wanted,
    motion: AskMotion = standing,
) -> Hokuyo | TurningLidar:
    """Return the driver, not yet running. motion: how the lidar moves, for those that take long for a turn."""
    if isinstance(settings, HokuyoSettings):
        return Hokuyo(settings, clock=clock, clear_s=clear_s)
    if isinstance(settings, RplidarSettings):
        return Rplidar(settings, clock=clock, clear_s=clear_s, motion=motion)
    return Ydlidar(settings, clock=clock, clear_s=clear_s, motion=motion)


def motion_of(car: CarSettings, motor: Callable[[], MotorState | None]) -> AskMotion:
    """Return what tells the lidar's motion by the wheels: speed, and the turn that their angle makes of it."""

    def motion() -> Motion:
        state = motor()
        if state is None or not math.isfinite(state.speed_mps + state.steering_rad):
            return STILL
        steering_rad = min(max(state.steering_rad, -car.max_steering_rad), car.max_steering_rad)
        yaw_rate_radps = state.speed_mps * math.tan(steering_rad) / car.wheelbase_m
        return Motion(state.speed_mps - yaw_rate_radps * car.lidar_y_m, yaw_rate_radps * car.lidar_x_m, yaw_rate_radps)

    return motion
