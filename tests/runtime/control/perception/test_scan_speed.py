"""The speed by scans: true where walls tell it, unknown between bare walls, whatever the lidar."""

import math

import numpy as np
import pytest

from wallride.drivers.api import MotorState
from wallride.drivers.pwm.speed_loop import SURE_MPS
from wallride.runtime.control.perception.scan_speed import ScanSpeed
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.virtual.closed_loop import as_scan
from wallride.sim.virtual.turning_sensor import TurningSensor
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.pose import Pose, Twist
from wallride.sim.world.worlds import load_world

CAR = CarSettings()
LIDAR = LidarSettings(noise_std_m=0.01)
STEERING_RAD = 0.15
STILL = Twist(0.0, 0.0, 0.0)


def estimates(world, speed_mps, *, rate_hz=40.0, seconds=2.0, steering_rad=0.0, pose=None):
    """Return (time, speed, spread) of a car that drives at a speed from the first scan on."""
    place, learns, rng = load_world(world), ScanSpeed(CAR), np.random.default_rng(3)
    pose = pose or place.start
    x_m, y_m, yaw_rad = pose.x_m, pose.y_m, pose.yaw_rad
    motor = MotorState(0.0, 0.0, 0.0, steering_rad)
    found = []
    for number in range(round(seconds * rate_hz)):
        now_s = number / rate_hz
        sent_mm = scan(place, Pose(x_m, y_m, yaw_rad), STILL, now_s, rng, LIDAR)
        told = learns.learn(as_scan(sent_mm, LIDAR, now_s, number), motor)
        found.append((now_s, told.speed_mps, told.spread_mps))
        turn_rad = speed_mps / rate_hz * math.tan(steering_rad) / CAR.wheelbase_m
        x_m += speed_mps / rate_hz * math.cos(yaw_rad + turn_rad / 2)
        y_m += speed_mps / rate_hz * math.sin(yaw_rad + turn_rad / 2)
        yaw_rad += turn_rad
    return np.array(found)


@pytest.mark.parametrize("rate_hz", [40.0, 10.0])
@pytest.mark.parametrize("speed_mps", [-0.5, 0.0, 0.5, 1.0, 2.0])
def test_the_speed_is_told_in_a_loop(speed_mps, rate_hz):
    later = estimates("loop", speed_mps, rate_hz=rate_hz)[round(rate_hz) :]
    assert np.abs(later[:, 1].mean() - speed_mps) < 0.03
    assert np.abs(later[:, 1] - speed_mps).max() < 0.25
    assert (later[:, 2] < SURE_MPS).all()


def test_the_speed_is_told_in_a_bend():
    later = estimates("loop", 1.0, steering_rad=STEERING_RAD, seconds=1.5)[40:]
    assert np.abs(later[:, 1].mean() - 1.0) < 0.05


@pytest.mark.parametrize("word", ["a1", "x4", "x2"])
def test_no_way_is_driven_by_what_a_slow_lidars_driver_takes_the_speed_for(word):
    place, learns, told_mps, found = load_world("loop"), ScanSpeed(CAR), [1.5, 0.5], []
    sensor = TurningSensor(
        word, LIDAR, CAR, lambda: MotorState(0.0, told_mps[len(found) % 2], 0.0, 0.0), np.random.default_rng(3)
    )
    for step in range(800):
        pose = Pose(place.start.x_m + 0.005 * step, place.start.y_m, place.start.yaw_rad)
        found += [learns.learn(one, None).speed_mps for one in sensor.measure(0.005 * step, place, pose)]
    assert np.abs(np.array(found[len(found) // 2 :]) - 1.0).max() < 0.2


@pytest.mark.parametrize("word", ["c1", "x2"])
def test_the_far_end_of_a_lane_tells_the_speed_to_a_lidar_of_one_degree(word):
    place, learns = load_world("loop"), ScanSpeed(CAR)
    motor = MotorState(0.0, 1.0, 0.0, 0.0)
    sensor = TurningSensor(word, LIDAR, CAR, lambda: motor, np.random.default_rng(3))
    spreads_mps = []
    for step in range(300):
        pose = Pose(0.005 * step, place.start.y_m, 0.0)
        spreads_mps += [learns.learn(one, motor).spread_mps for one in sensor.measure(0.005 * step, place, pose)]
    assert max(spreads_mps[len(spreads_mps) // 2 :]) < SURE_MPS


def test_between_bare_walls_nothing_is_told():
    later = estimates("corridor", 1.0)[40:]
    assert (later[:, 2] > SURE_MPS).all()


def test_a_gap_begins_anew():
    learns, place = ScanSpeed(CAR), load_world("loop")
    rng = np.random.default_rng(1)
    for number, now_s in enumerate([0.0, 0.025, 0.05, 3.0]):
        sent_mm = scan(place, place.start, STILL, now_s, rng, LIDAR)
        told = learns.learn(as_scan(sent_mm, LIDAR, now_s, number), None)
    assert told.spread_mps > SURE_MPS
