"""Settings of a VESC; the defaults are those of the stock F1TENTH and MIT cars."""

from functools import partial
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from wallride.drivers.address import at_hand
from wallride.drivers.section import Section

BY_CABLE = ": write serial:///dev/NAME (or tcp://127.0.0.1:PORT for a bridge on this computer)"
"""What to write in place of another computer's address."""
MISSED_POLLS_MIN = 3
"""Minimum number of missed polls before a link counts as lost."""


class VescSettings(Section):
    """A VESC 4 or 6 on USB; unknown keys and numbers outside their bounds are errors.

    There is no "invert" here on purpose: positive ERPM is forward. Where the car runs backwards, swap two motor
    phases or set the inversion inside the VESC, so that speed, distance and command agree everywhere.
    """

    driver: Annotated[Literal["vesc"], Field(description="Type of the motor controller.")] = "vesc"
    address: Annotated[
        str,
        AfterValidator(partial(at_hand, remedy=BY_CABLE)),
        Field(description="Serial port by its udev name, which is stable; ttyACM numbers are not."),
    ] = "serial:///dev/wallride-vesc"
    speed_to_erpm_gain: Annotated[
        float,
        Field(ge=200, le=100_000, description="ERPM per m/s: 60 x pole pairs x gear ratio / wheel circumference."),
    ] = 4614.0
    speed_to_erpm_offset: Annotated[float, Field(ge=-5000, le=5000, description="ERPM at 0 m/s; normally 0.")] = 0.0
    steering_to_servo_gain: Annotated[
        float, Field(ge=-10, le=10, description="Servo position per rad; negative where a longer pulse steers right.")
    ] = -1.2135
    steering_to_servo_offset: Annotated[float, Field(ge=0, le=1, description="Servo position straight ahead.")] = 0.5304
    servo_min: Annotated[float, Field(ge=0, le=1, description="Minimum servo position of the linkage.")] = 0.15
    servo_max: Annotated[float, Field(ge=0, le=1, description="Maximum servo position of the linkage.")] = 0.85
    brake_current_a: Annotated[
        float,
        Field(
            ge=1,
            le=100,
            description="Brake current of a stop; about 46 A lock the stock car's wheels on a clean floor.",
        ),
    ] = 50.0
    brake_mps2_per_a: Annotated[
        float,
        Field(gt=0, le=5, description="Deceleration per ampere of brake current, for gentle stops in a bend."),
    ] = 0.17
    min_speed_mps: Annotated[
        float,
        Field(
            ge=0.05,
            le=1,
            description="Minimum speed; slower is a stop. A VESC coasts below s_pid_min_erpm: 900 = 0.195 m/s.",
        ),
    ] = 0.2
    poll_hz: Annotated[float, Field(ge=10, le=200, description="Rate of reading the VESC's values.")] = 50.0
    lost_after_s: Annotated[
        float, Field(ge=0.05, le=5, description="Time without a reply after which the link is lost.")
    ] = 0.2
    min_voltage_v: Annotated[
        float,
        Field(
            ge=0,
            le=60,
            description="Minimum battery voltage; below it the battery is absent or empty (VESC default: 8.0 V).",
        ),
    ] = 8.0
    imu: Annotated[
        bool, Field(description="Read the inertial sensor as well, for telemetry and the heading of `odom`.")
    ] = True

    @property
    def servo_ends_rad(self) -> tuple[float, float]:
        """Return the largest angles to the right, negative, and to the left, within servo_min and servo_max."""
        ends = (self.servo_min, self.servo_max)
        right, left = sorted((end - self.steering_to_servo_offset) / self.steering_to_servo_gain for end in ends)
        return right, left

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.steering_to_servo_gain == 0:
            raise ValueError("steering_to_servo_gain is 0: the car could not steer")
        if not self.servo_min < self.servo_max:
            raise ValueError(f"servo_min {self.servo_min} must be below servo_max {self.servo_max}")
        if not self.servo_min <= self.steering_to_servo_offset <= self.servo_max:
            raise ValueError(
                f"steering_to_servo_offset {self.steering_to_servo_offset} (straight ahead) must lie within"
                f" servo_min {self.servo_min} and servo_max {self.servo_max}"
            )
        if self.lost_after_s * self.poll_hz < MISSED_POLLS_MIN:
            raise ValueError(
                f"lost_after_s {self.lost_after_s} is less than {MISSED_POLLS_MIN} polls at {self.poll_hz:g} Hz:"
                f" one late reply would count as a lost link; use {MISSED_POLLS_MIN / self.poll_hz:.3f} or more"
            )
        return self
