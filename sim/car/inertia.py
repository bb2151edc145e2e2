"""The inertial sensor of the emulated VESC: the car's motion with bias, scale error and noise, in the wire's units.

x forward, y left, z up. The numbers are of the kind that small MEMS sensors show after their own calibration.
"""

import math
import random
from typing import Final

from wallride.drivers.vesc.replies import STANDARD_GRAVITY_MPS2
from wallride.sim.car.vehicle import Vehicle

MEMS_BIAS_G: Final = (0.02, -0.015, 0.03)
MEMS_BIAS_DEGPS: Final = (0.3, -0.2, 0.4)
MEMS_SCALE: Final = 1.01
NOISE_G, NOISE_DEGPS = 0.01, 0.1
_SEED: Final = 11


class EmulatedImu:
    """Measures a vehicle at the rear axle; call `measure` with each step of it."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._before = vehicle.twist
        self._random = random.Random(_SEED)

    def measure(self, over_s: float) -> tuple[float, ...]:
        """Return the 16 numbers of GET_IMU_DATA (rad, g, deg/s, uT, quaternion w x y z), of the time since the last.

        Accelerations beyond 4 g are cut off, as of a car that hits something.
        """
        before, now = self._before, self._vehicle.twist
        self._before = now
        rate_radps = now.yaw_rate_radps
        along_mps2 = (now.speed_mps - before.speed_mps) / over_s - rate_radps * now.lateral_mps
        aside_mps2 = (now.lateral_mps - before.lateral_mps) / over_s + rate_radps * now.speed_mps
        true_g = along_mps2 / STANDARD_GRAVITY_MPS2, aside_mps2 / STANDARD_GRAVITY_MPS2, 1.0
        true_degps = 0.0, 0.0, math.degrees(rate_radps)
        yaw_rad = self._vehicle.pose.yaw_rad
        return (
            0.0, 0.0, yaw_rad,
            *(max(-4.0, min(one, 4.0)) for one in self._reported(true_g, MEMS_BIAS_G, NOISE_G)),
            *self._reported(true_degps, MEMS_BIAS_DEGPS, NOISE_DEGPS),
            0.0, 0.0, 0.0, math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2),
        )  # fmt: skip

    def _reported(self, true: tuple[float, ...], bias: tuple[float, ...], noise: float) -> list[float]:
        return [MEMS_SCALE * one + of + self._random.gauss(0.0, noise) for one, of in zip(true, bias, strict=True)]
