"""The car as its laws know it: with the ends of steering that the motor driver's limits leave."""

from wallride.drivers.pwm.settings import PwmSettings
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.control.vehicle import CarSettings, ServoCar
from wallride.runtime.settings.tree import Settings


def driven_car(settings: Settings) -> CarSettings:
    """Return the car; with the stock `servo_min`, `servo_max` and offset it turns less, and less to the right.

    A law that counts on more runs wide where there is no room. What an own motor driver limits is not known.
    """
    car, motor = settings.car, settings.motor
    if not isinstance(motor, VescSettings | PwmSettings):
        return car
    right_rad, left_rad = motor.servo_ends_rad
    if -right_rad >= car.max_steering_rad <= left_rad:
        return car
    return ServoCar(**car.model_dump(), servo_ends_rad=(right_rad, left_rad))
