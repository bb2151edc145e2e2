"""Conversion between SI and the VESC's units, and the frames: the one place that defines signs, gains and clamps."""

import math

from wallride.drivers.vesc import codec
from wallride.drivers.vesc.settings import VescSettings

_STEPS_PER_ERPM_MINUTE = 6
_SECONDS_PER_MINUTE = 60
_MIN_BRAKE_A = 1.0


class Calibration:
    """Converts one car's speeds and steering angles; built once, used fifty times a second.

    brake: the frame of a stop, built in advance so that its construction cannot fail when it is needed.
    metres_per_step: distance per tachometer step, 60 / 6 / gain.
    """

    def __init__(self, settings: VescSettings) -> None:
        self._settings = settings
        self.brake = codec.frame(codec.set_brake_current(settings.brake_current_a))
        self.metres_per_step = _SECONDS_PER_MINUTE / _STEPS_PER_ERPM_MINUTE / settings.speed_to_erpm_gain

    def speed_mps(self, erpm: int) -> float:
        """Return the speed at this electrical speed; 0 is 0, whatever the offset."""
        if erpm == 0:
            return 0.0
        return (erpm - self._settings.speed_to_erpm_offset) / self._settings.speed_to_erpm_gain

    def speed_frame(self, speed_mps: float) -> bytes:
        """Return the frame that holds a speed; ValueError for NaN, infinity and speeds beyond the wire."""
        settings = self._settings
        return codec.frame(codec.set_erpm(settings.speed_to_erpm_gain * speed_mps + settings.speed_to_erpm_offset))

    def brake_frame(self, brake_mps2: float) -> bytes:
        """Return the frame of a stop that brakes no harder than this; full braking for infinity and for NaN.

        Never less than _MIN_BRAKE_A: a stop is requested, and under 0.05 A the firmware would coast.
        """
        settings = self._settings
        wanted_a = brake_mps2 / settings.brake_mps2_per_a
        if not wanted_a < settings.brake_current_a:  # NaN compares as not smaller
            return self.brake
        return codec.frame(codec.set_brake_current(max(_MIN_BRAKE_A, wanted_a)))

    def is_stop(self, speed_mps: float) -> bool:
        """Tell whether the VESC's speed loop cannot hold this speed, which therefore means a stop."""
        return abs(speed_mps) < self._settings.min_speed_mps

    def allowed_steering_rad(self, steering_rad: float) -> float:
        """Return the steering clamped to the servo's limits; ValueError for NaN and infinity."""
        if not math.isfinite(steering_rad):
            raise ValueError(f"steering {steering_rad!r} rad is not an angle")
        settings = self._settings
        wanted = settings.steering_to_servo_gain * steering_rad + settings.steering_to_servo_offset
        allowed = min(max(wanted, settings.servo_min), settings.servo_max)
        if allowed == wanted:
            return steering_rad
        return (allowed - settings.steering_to_servo_offset) / settings.steering_to_servo_gain

    def servo_frame(self, steering_rad: float) -> bytes:
        """Return the frame that steers to an allowed angle; the wire rounds to 0.001, 1 us of pulse."""
        settings = self._settings
        return codec.frame(
            codec.set_servo(settings.steering_to_servo_gain * steering_rad + settings.steering_to_servo_offset)
        )
