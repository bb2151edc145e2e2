"""The emulated inertial sensor, as the VESC's driver reads it."""

import math
from typing import Any

import numpy as np
import pytest

from wallride.drivers.vesc.codec import Packet
from wallride.drivers.vesc.replies import decode_imu
from wallride.drivers.vesc.settings import VescSettings
from wallride.sim.car.plant import MEMS_BIAS_DEGPS, MEMS_BIAS_G, Plant
from wallride.sim.car.vehicle import Vehicle
from wallride.sim.devices.vesc import MotorDemand
from wallride.sim.devices.vesc_replies import imu_reply

WIRING = VescSettings()
REQUEST = bytes((Packet.GET_IMU_DATA, 0xFF, 0xFF))


class Controller:
    """A motor controller whose last command stays: speed and wheel angle."""

    def __init__(self, speed_mps, steering_rad):
        self.imu = ()
        self.servo = WIRING.steering_to_servo_gain * steering_rad + WIRING.steering_to_servo_offset
        self._erpm = speed_mps * WIRING.speed_to_erpm_gain

    def demand(self, _now_s):
        return MotorDemand("speed", self._erpm)

    def report(self, **_values):
        pass


def drive(speed_mps, steering_rad):
    """Return mean and deviation of acceleration and turn, as read in the last two of four seconds, and the car."""
    vehicle = Vehicle()
    controller: Any = Controller(speed_mps, steering_rad)  # instead of the emulated one
    plant = Plant(vehicle, controller, WIRING, 0.0)
    seen = []
    for millisecond in range(10, 4000, 10):
        plant.advance(millisecond / 1000)
        imu = decode_imu(imu_reply((6, 5), REQUEST, controller.imu, 1)) if controller.imu else None
        if imu is not None and millisecond > 2000:
            seen.append((*imu.acceleration_mps2, *imu.rate_radps))
    assert len(seen) > 190
    return np.mean(seen, axis=0), np.std(seen, axis=0), vehicle


def test_standing_it_shows_gravity_bias_scale_and_noise():
    mean, deviation, _ = drive(0.0, 0.0)
    assert mean[2] == pytest.approx(9.81 * (1.01 + MEMS_BIAS_G[2]), abs=0.05)
    assert math.degrees(mean[5]) == pytest.approx(MEMS_BIAS_DEGPS[2], abs=0.1)
    assert deviation[:3] == pytest.approx([0.098] * 3, rel=0.3)
    assert np.degrees(deviation[3:]) == pytest.approx([0.1] * 3, rel=0.3)


def test_in_a_curve_it_shows_the_turn_and_the_force_towards_its_middle():
    mean, _, vehicle = drive(1.5, 0.2)
    turn_radps, speed_mps = vehicle.yaw_rate_radps, vehicle.speed_mps
    assert turn_radps > 0.5
    assert mean[5] == pytest.approx(1.01 * turn_radps + math.radians(MEMS_BIAS_DEGPS[2]), abs=0.02)
    assert mean[1] == pytest.approx(1.01 * turn_radps * speed_mps + 9.81 * MEMS_BIAS_G[1], abs=0.15)
