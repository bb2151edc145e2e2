"""Settings that every motor by servo pulses has: the pulses of this car's servo and ESC, and what it may do."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from wallride.drivers.section import Section

PulseUs = Annotated[float, Field(ge=800, le=2200)]


class PwmSettings(Section):
    """Pulses in microseconds. The defaults are those of usual servos and ESCs, and have to be measured."""

    throttle_channel: Annotated[int, Field(ge=0, le=23, description="Output with the ESC.")] = 0
    steering_channel: Annotated[int, Field(ge=0, le=23, description="Output with the steering servo.")] = 1
    steering_center_us: Annotated[PulseUs, Field(description="Pulse [us] that drives straight.")] = 1500.0
    steering_us_per_rad: Annotated[
        float,
        Field(ge=-5000, le=5000, description="Pulse [us] per rad; negative where a longer pulse steers right."),
    ] = -1150.0
    steering_min_us: Annotated[PulseUs, Field(description="Shortest pulse [us] of the linkage.")] = 1100.0
    steering_max_us: Annotated[PulseUs, Field(description="Longest pulse [us] of the linkage.")] = 1900.0
    neutral_us: Annotated[PulseUs, Field(description="Pulse [us] at which the ESC neither drives nor brakes.")] = 1500.0
    brake_us: Annotated[
        PulseUs, Field(description="Pulse [us] of a stop; that of neutral where the ESC does not brake.")
    ] = 1200.0
    forward_us: Annotated[PulseUs, Field(description="Pulse [us] at which the wheels begin to turn forward.")] = 1550.0
    reverse_us: Annotated[PulseUs, Field(description="Pulse [us] at which they begin to turn backward.")] = 1450.0
    throttle_us_per_mps: Annotated[
        float, Field(ge=5, le=500, description="Pulse [us] beyond these for each m/s, on a charged battery.")
    ] = 50.0
    throttle_reach_us: Annotated[
        float, Field(ge=20, le=700, description="Maximum distance [us] of a driving pulse from neutral.")
    ] = 300.0
    min_speed_mps: Annotated[float, Field(ge=0.05, le=1, description="Minimum speed; slower is a stop.")] = 0.2
    max_speed_mps: Annotated[
        float, Field(gt=0, le=4, description="Maximum speed; 1.5 without a command timeout of the board.")
    ] = 2.0
    blind_speed_mps: Annotated[
        float, Field(ge=0.1, le=1, description="Maximum speed while the scans do not tell the speed.")
    ] = 0.5
    arming_s: Annotated[
        float, Field(ge=0.2, le=10, description="Time of neutral after connecting, for which the ESC waits.")
    ] = 1.5

    @property
    def servo_ends_rad(self) -> tuple[float, float]:
        """Return the largest angles to the right, negative, and to the left, within the linkage's pulses."""
        ends_us = (self.steering_min_us, self.steering_max_us)
        right, left = sorted((end_us - self.steering_center_us) / self.steering_us_per_rad for end_us in ends_us)
        return right, left

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.throttle_channel == self.steering_channel:
            raise ValueError(f"throttle_channel and steering_channel are both {self.throttle_channel}")
        if not self.steering_min_us <= self.steering_center_us <= self.steering_max_us or not self.steering_us_per_rad:
            raise ValueError("steering_center_us must lie within steering_min_us and steering_max_us, with a gain")
        if (self.forward_us - self.neutral_us) * (self.reverse_us - self.neutral_us) >= 0:
            raise ValueError("forward_us and reverse_us must lie on different sides of neutral_us")
        if (self.forward_us - self.neutral_us) * (self.brake_us - self.neutral_us) > 0:
            raise ValueError("brake_us must not lie on the side of neutral_us on which the car drives forward")
        if self.blind_speed_mps < self.min_speed_mps:
            raise ValueError(
                "blind_speed_mps must not be below min_speed_mps: the car could not move where it is blind"
            )
        return self
