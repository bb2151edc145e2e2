"""Delay and slip between the wheels' angle and the yaw rate: tyres and inertia, which the simulated car has by itself.

A delay that is fitted to yaw rates contains 8 ms of them at 0.5 m/s and 35 ms at 2.5 m/s. So the simulated car is
given the fitted steering, drives the same commands at the same speeds, and is measured in the same way; what it needs
longer than it was told, and turns less, is taken off (indirect inference, Gouriéroux, Monfort and Renault 1993).
"""

from dataclasses import replace

import numpy as np

from wallride.runtime.calibration.responses import CommandSteps, Samples
from wallride.sim.car.vehicle import SpeedDemand, Vehicle, VehicleSettings
from wallride.sim.world.pose import Floats, Pose

STEP_S = 0.0025
EXACT_DRIVE = VehicleSettings(drive_delay_s=0.0, speed_lag_s=0.01, ramp_mps2=50.0, drive_limit_mps2=50.0)
"""A car that has the recorded speed at once."""


def simulated_angles(
    command: CommandSteps,
    speed: CommandSteps,
    samples: Samples,
    *,
    delay_s: float,
    rate_radps: float,
    wheelbase_m: float,
) -> Samples:
    """Return what `samples` would be of the simulated car with this steering. speed: the recorded one over time."""
    steering = {"steering_delay_s": delay_s, "steering_rate_radps": rate_radps}
    car = Vehicle(EXACT_DRIVE.model_copy(update=steering), Pose(0.0, 0.0, 0.0))
    times_s = np.arange(float(samples.from_s[0]) - 1.0, float(samples.to_s[-1]) + STEP_S, STEP_S)
    wanted_rad, wanted_mps, yaw_rad = command.at(times_s), speed.at(times_s), np.zeros(times_s.size)
    demand = SpeedDemand(0.0)
    for k in range(times_s.size - 1):
        if demand.mps != wanted_mps[k]:
            demand = SpeedDemand(float(wanted_mps[k]))
        car.step(STEP_S, demand, float(wanted_rad[k]))
        yaw_rad[k + 1] = yaw_rad[k] + car.yaw_rate_radps * STEP_S
    turned_rad = np.interp(samples.to_s, times_s, yaw_rad) - np.interp(samples.from_s, times_s, yaw_rad)
    speed_mps = speed.at((samples.from_s + samples.to_s) / 2)
    angle_rad: Floats = np.arctan(turned_rad / (samples.to_s - samples.from_s) * wheelbase_m / speed_mps)
    return replace(samples, value=angle_rad)
