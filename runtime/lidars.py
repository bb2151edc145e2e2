"""The drivers of the lidar and the motor controller that the settings name."""

import math
import time
from collections.abc import Callable

from wallride.drivers.api import Clock, MotorState, Reschedule, as_wanted
from wallride.drivers.auto.settings import AutoLidarSettings
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.maestro.driver import Maestro
from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pca9685.driver import Pca9685
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.rplidar.driver import Rplidar
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.turning.driver import TurningLidar
from wallride.drivers.turning.grid import STILL, AskMotion, Motion, standing
from wallride.drivers.vesc.driver import Vesc
from wallride.drivers.ydlidar.driver import Ydlidar
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.control.wall_following.prediction import slew_towards
from wallride.runtime.own_drivers.driver_class import load_driver
from wallride.runtime.own_drivers.lidar import OwnLidar
from wallride.runtime.own_drivers.motor import OwnMotor
from wallride.runtime.own_drivers.running import DriverRun
from wallride.runtime.own_drivers.settings import OwnLidarSettings, OwnMotorSettings
from wallride.runtime.scan_topic import TopicLidar
from wallride.runtime.settings.devices import AnyLidarSettings, AnyMotorSettings, TopicLidarSettings


def lidar_for(
    settings: AnyLidarSettings,
    *,
    clock: Clock = time.monotonic,
    clear_s: Reschedule = as_wanted,
    motion: AskMotion = standing,
) -> Hokuyo | TurningLidar | TopicLidar | OwnLidar:
    """Return the driver, not yet running. motion: how the lidar moves, for those that take long for a turn."""
    if isinstance(settings, HokuyoSettings):
        return Hokuyo(settings, clock=clock, clear_s=clear_s)
    if isinstance(settings, AutoLidarSettings):
        raise TypeError('lidar.driver = "auto" names no driver: give the settings that find_lidar returns')
    if isinstance(settings, OwnLidarSettings):
        return OwnLidar(settings, clock=clock)
    if isinstance(settings, TopicLidarSettings):
        return TopicLidar(settings, clock=clock)
    if isinstance(settings, RplidarSettings):
        return Rplidar(settings, clock=clock, clear_s=clear_s, motion=motion)
    return Ydlidar(settings, clock=clock, clear_s=clear_s, motion=motion)


def motor_for(
    settings: AnyMotorSettings,
    *,
    clock: Clock = time.monotonic,
    clear_s: Reschedule = as_wanted,
    replied: Callable[[float], None] = lambda _took_s: None,
) -> Vesc | Maestro | Pca9685 | OwnMotor:
    """Return the driver, not yet running. replied: called with the duration of a reply, by drivers that measure it."""
    if isinstance(settings, OwnMotorSettings):
        return OwnMotor(settings, clock=clock)
    if isinstance(settings, MaestroSettings):
        return Maestro(settings, clock=clock)
    if isinstance(settings, Pca9685Settings):
        return Pca9685(settings, clock=clock)
    return Vesc(settings, clock=clock, clear_s=clear_s, replied=replied)


def own_driver_mistakes(lidar: AnyLidarSettings, motor: AnyMotorSettings, clock: Clock = time.monotonic) -> list[str]:
    """Return what is wrong with making the own drivers that the settings name, one sentence each; nothing is opened."""
    named = [("lidar", lidar), ("motor", motor)]
    runs = [
        DriverRun(load_driver(section, settings.driver), settings.own, clock)
        for section, settings in named
        if isinstance(settings, OwnLidarSettings | OwnMotorSettings)
    ]
    return [run.fault for run in runs if not run.make()]


class TurnMotion:
    """Tells the lidar's motion during a turn by the wheels: speed, and what the slewing servo made of the commands.

    Asked once a turn. The commanded angle alone takes turns out of a scan that the car has not made yet: at 2 m/s and
    10 Hz it swings by that.
    """

    def __init__(self, car: CarSettings, motor: Callable[[], MotorState | None]) -> None:
        self._car = car
        self._motor = motor
        self._stamp_s = math.nan
        self._servo_rad = 0.0

    def __call__(self) -> Motion:
        """Return the mean motion since the last call."""
        state, car = self._motor(), self._car
        if state is None or not math.isfinite(state.speed_mps + state.steering_rad):
            self._stamp_s = math.nan
            return STILL
        since_s, self._stamp_s = state.stamp_s - self._stamp_s, state.stamp_s
        wanted_rad = min(max(state.steering_rad, -car.max_steering_rad), car.max_steering_rad)
        yaw_rate_radps = state.speed_mps * math.tan(self._slew(wanted_rad, since_s)) / car.wheelbase_m
        return Motion(state.speed_mps - yaw_rate_radps * car.lidar_y_m, yaw_rate_radps * car.lidar_x_m, yaw_rate_radps)

    def _slew(self, wanted_rad: float, since_s: float) -> float:
        """Turn the servo for a time, as fast as it can; return the middle between its angles before and after.

        The command of the scan before reaches the wheels in the middle of the turn: later than at its start by the
        delays of wire and servo, and then slewing.
        """
        before_rad, most_rad = self._servo_rad, self._car.steering_rate_radps * since_s
        self._servo_rad = slew_towards(before_rad, wanted_rad, most_rad) if since_s > 0.0 else wanted_rad  # NaN is not
        return (before_rad + self._servo_rad) / 2.0 if since_s > 0.0 else wanted_rad
