"""Vehicle parameters used by the control laws."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from wallride.drivers.section import Section

GRAVITY_MPS2 = 9.81
NAME_RULE = "1 to 32 of a-z, 0-9, - and _, beginning with a letter or digit"


class CarSettings(Section):
    """The vehicle, measured with a ruler. base_link is the middle of the rear axle (REP-105)."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")] = "car1"
    """Name of the car, part of each of its topics: wallride/NAME/..."""
    wheelbase_m: Annotated[float, Field(gt=0.05, le=2.0)] = 0.33
    """Distance from the front axle to the rear axle."""
    max_steering_rad: Annotated[float, Field(gt=0.05, lt=1.2)] = 0.34
    """Maximum steering angle of the front wheels, also of commands."""
    steering_rate_radps: Annotated[float, Field(gt=0, le=50)] = 3.2
    """Steering rate of the servo."""
    max_speed_mps: Annotated[float, Field(gt=0, le=20)] = 4.0
    """Maximum forward speed sent to the motor, for every source."""
    max_reverse_mps: Annotated[float, Field(ge=0, le=5)] = 1.0
    """Maximum backward speed sent to the motor, for every source."""
    max_acceleration_mps2: Annotated[float, Field(gt=0, le=20)] = 4.0
    """Maximum rise of the commanded speed; slowing down is not limited."""
    lidar_x_m: Annotated[float, Field(ge=-1, le=2)] = 0.27
    """Distance of the lidar ahead of the rear axle."""
    lidar_y_m: Annotated[float, Field(ge=-1, le=1)] = 0.0
    """Distance of the lidar left of the middle line; negative: right."""
    front_m: Annotated[float, Field(gt=0, le=3)] = 0.42
    """Distance from the rear axle to the front end of the car."""
    rear_m: Annotated[float, Field(gt=0, le=3)] = 0.13
    """Distance from the rear axle to the rear end of the car."""
    half_width_m: Annotated[float, Field(gt=0, le=1)] = 0.15
    """Half of the maximum width of the car, wheels and mirrors included."""

    @model_validator(mode="after")
    def _its_parts_are_inside(self) -> Self:
        for name, place_m in (("wheelbase_m", self.wheelbase_m), ("lidar_x_m", self.lidar_x_m)):
            if self.front_m < place_m:
                raise ValueError(
                    f"front_m = {self.front_m:g} is less than {name} = {place_m:g}: measure it from the rear axle to"
                    " the front end"
                )
        return self

    @property
    def lidar_m(self) -> complex:
        """Return the place of the lidar in base_link, x + iy."""
        return complex(self.lidar_x_m, self.lidar_y_m)

    @property
    def steering_ends_rad(self) -> tuple[float, float]:
        """Return the largest angles to the right, negative, and to the left."""
        return -self.max_steering_rad, self.max_steering_rad

    @property
    def narrower_end_rad(self) -> float:
        """Return the largest angle that the wheels reach to either side."""
        return min(-self.steering_ends_rad[0], self.steering_ends_rad[1])

    def steered_rad(self, asked_rad: float) -> float:
        """Return the angle to which the wheels are steered when an angle is asked for."""
        right_rad, left_rad = self.steering_ends_rad
        return min(max(asked_rad, right_rad), left_rad)


class ServoCar(CarSettings):
    """A car whose servo may not reach `max_steering_rad`, or not to either side, as its motor's settings limit it."""

    servo_ends_rad: tuple[float, float]

    @property
    def steering_ends_rad(self) -> tuple[float, float]:
        """Return the largest angles to the right, negative, and to the left."""
        right_rad, left_rad = self.servo_ends_rad
        return max(-self.max_steering_rad, right_rad), min(self.max_steering_rad, left_rad)
