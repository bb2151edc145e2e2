"""Parameters of the simulated car. Defaults: an F1TENTH car on the sources named, on a clean hard floor."""

from typing import Annotated

from pydantic import Field

from wallride.drivers.section import Section

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class VehicleSettings(Section):
    """A 1/10-scale four-wheel-drive car (f1tenth_gym `f110_env.py` for mass, axles, inertia, tyres).

    cornering_*: lateral force per slip angle as a multiple of grip times load; the tyre saturates at the grip.
    trim_rad: wheel angle while the servo stands in the middle, left positive: the residual error of the calibration.
    drag_mps2: deceleration while coasting, of drivetrain and tyres. Estimated, not measured.
    drive_limit_mps2: the motor's strength; floor grip may allow less.
    ramp_mps2: rate of change of the motor controller's own set speed (VESC firmware 6: 25000 erpm/s at 4614 erpm per
    m/s).
    min_speed_mps: below this set speed a VESC's speed control gives no output (900 erpm).
    speed_lag_s: time constant of the speed control behind its set speed.
    brake_mps2_per_a: deceleration per ampere of brake current, before the wheels lock. A motor of 3500 rpm/V gives
        2.7 mNm/A; 4614 erpm per m/s and 2 pole pairs are 242 rad per metre, so 0.66 N/A: 46 A lock the wheels.
    wheel_mass_kg: inertia of all wheels and the motor as a mass at the tread: how fast a braked wheel locks.
    """

    wheelbase_m: Positive = 0.33
    rear_axle_to_cg_m: Positive = 0.17145
    cg_height_m: NotNegative = 0.074
    mass_kg: Positive = 3.74
    yaw_inertia_kgm2: Positive = 0.04712
    grip_mu: Annotated[float, Field(gt=0, le=2)] = 0.8
    cornering_front_per_rad: Positive = 4.718
    cornering_rear_per_rad: Positive = 5.4562
    max_steering_rad: Annotated[float, Field(gt=0, lt=1.2)] = 0.34
    steering_rate_radps: Positive = 3.2
    trim_rad: Annotated[float, Field(ge=-0.3, le=0.3)] = 0.0
    steering_delay_s: NotNegative = 0.02
    drive_delay_s: NotNegative = 0.02
    drive_limit_mps2: Positive = 7.0
    ramp_mps2: Positive = 5.4
    min_speed_mps: NotNegative = 0.195
    speed_lag_s: Positive = 0.05
    drag_mps2: NotNegative = 0.4
    brake_mps2_per_a: Positive = 0.17
    wheel_mass_kg: Positive = 0.4

    @property
    def front_axle_to_cg_m(self) -> float:
        """Return the distance between front axle and centre of gravity."""
        return self.wheelbase_m - self.rear_axle_to_cg_m
