"""Difference between the gains of a car and those in its settings: errors that a calibration has to find."""

from typing import Annotated

from pydantic import Field

from wallride.drivers.section import Section
from wallride.drivers.vesc.settings import VescSettings
from wallride.runtime.settings.devices import AnyMotorSettings


class WiringErrors(Section):
    """True values of a car whose settings say something else; by default they are right.

    speed_gain_share: ERPM per m/s over the configured one. servo_offset: servo position straight ahead, less the
    configured one. servo_gain_share: servo position per rad over the configured one.
    """

    speed_gain_share: Annotated[float, Field(ge=0.3, le=3)] = 1.0
    servo_offset: Annotated[float, Field(ge=-0.3, le=0.3)] = 0.0
    servo_gain_share: Annotated[float, Field(ge=0.3, le=3)] = 1.0

    def wired(self, settings: AnyMotorSettings) -> VescSettings:
        """Return the true gains of a car with these settings; the usual ones where its motor is no VESC."""
        configured = settings if isinstance(settings, VescSettings) else VescSettings()
        if self == NO_ERRORS:
            return configured
        return configured.model_copy(
            update={
                "speed_to_erpm_gain": configured.speed_to_erpm_gain * self.speed_gain_share,
                "steering_to_servo_offset": configured.steering_to_servo_offset + self.servo_offset,
                "steering_to_servo_gain": configured.steering_to_servo_gain * self.servo_gain_share,
            }
        )


NO_ERRORS = WiringErrors()


class WiringConversion:
    """Converts between what the settings say and what the car does. Without a difference all values stay as they are.

    configured: settings of the runtime. wired: true gains of the car.
    """

    def __init__(self, configured: VescSettings, wired: VescSettings) -> None:
        self._configured, self._wired = configured, wired
        self.speed_share = configured.speed_to_erpm_gain / wired.speed_to_erpm_gain
        """True speed over the commanded, and reported, one."""

    def steering_rad(self, asked_rad: float) -> float:
        """Return the true servo angle of a commanded one, within the configured limits of the servo."""
        servo, wired = self._servo(asked_rad), self._wired
        if self._configured == wired:
            return self.allowed_rad(asked_rad)
        return (servo - wired.steering_to_servo_offset) / wired.steering_to_servo_gain

    def allowed_rad(self, asked_rad: float) -> float:
        """Return the commanded angle as the driver reports it: within the servo's limits."""
        right_rad, left_rad = self._configured.servo_ends_rad
        return min(max(asked_rad, right_rad), left_rad)

    def _servo(self, asked_rad: float) -> float:
        own = self._configured
        servo = own.steering_to_servo_gain * asked_rad + own.steering_to_servo_offset
        return min(max(servo, own.servo_min), own.servo_max)
