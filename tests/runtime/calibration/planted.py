"""A room as labs are, and a car in it with errors in its settings."""

import math

import numpy as np

from tests.runtime.calibration.calibrated_car import PlantedCar, VirtualCar
from wallride.clients.calibration import ways
from wallride.runtime.calibration.arc_fit import AssumedCar
from wallride.runtime.calibration.measured_car import measure_arcs, measure_braking, measure_delays
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.car.wiring import WiringErrors
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry, chain

LAB = World(
    "lab",
    SegmentGeometry(
        chain([(-2.0, -2.3), (4.6, -2.3), (4.6, 2.6), (2.9, 2.6), (2.9, 3.4), (-2.0, 3.4)], closed=True),
        np.array([[3.9, -1.2, 0.25], [-1.2, 2.0, 0.3]]),
    ),
    Pose(0.0, 0.0, 0.1),
)
CORRIDOR = World(
    "corridor",
    SegmentGeometry(np.array([*chain([(-60.0, 1.0), (60.0, 1.0)]), *chain([(-60.0, -1.0), (60.0, -1.0)])])),
    Pose(0.0, 0.0, 0.0),
)
ERRORS = WiringErrors(speed_gain_share=1.15, servo_offset=0.03)
TRUE_SPEED = 1 / 1.15
TRUE_OFFSET_RAD = 0.03 / 1.2135
YAW_RAD = math.radians(2.0)
ASSUMED = AssumedCar(wheelbase_m=0.25, lidar_x_m=0.27)
MOUNT = {"mount_x_m": 0.29, "mount_y_m": 0.02, "mount_yaw_rad": YAW_RAD}
ROUGH = {"noise_std_m": 0.02, "outlier_share": 0.02, "dropout_share": 0.02}
SLOW = VehicleSettings(wheelbase_m=0.33, steering_delay_s=0.06, drive_delay_s=0.06)


def planted_car(seed=0, world=LAB, *, own_parts="none", vehicle=SLOW, errors=ERRORS, **lidar):
    settings = LidarSettings(**{**ROUGH, **MOUNT, "own_parts": own_parts, **lidar})
    return VirtualCar(world, PlantedCar(vehicle, settings, errors), seed=seed)


def arcs_of(car, assumed=ASSUMED):
    begin_s = car.now_s
    ways.drive_arcs(car)
    return measure_arcs(car.seen.trace().between(begin_s, car.now_s), assumed)


def delays_of(car, arcs):
    begin_s = car.now_s
    ways.drive_weaves(car)
    return measure_delays(car.seen.trace().between(begin_s, car.now_s), arcs, 3.2)


def braking_of(car, arcs, delay_s):
    begin_s = car.now_s
    ways.drive_stops(car)
    return measure_braking(car.seen.trace().between(begin_s, car.now_s), arcs, delay_s)
