"""Recordings of simulated drives with planted parameters."""

import numpy as np

from wallride.sim.car.vehicle import SpeedDemand, Vehicle, VehicleSettings
from wallride.sim.recordings import CommandTrack, OdometryTrack, Recording
from wallride.sim.world.beams import LidarSettings, scan
from wallride.sim.world.place import World
from wallride.sim.world.pose import Pose
from wallride.sim.world.segments import SegmentGeometry, chain

STEP_S = 0.0025
SCAN_S = 0.025
ROOM = SegmentGeometry(
    chain([(-2.0, -4.0), (9.0, -4.0), (9.0, -1.5), (12.0, -1.5), (26.0, -4.0), (26.0, 5.0), (8.0, 3.0), (-2.0, 4.0)],
          closed=True),
    np.array([[4.0, 2.5, 0.3], [7.0, -3.0, 0.2], [13.0, 3.0, 0.4], [17.0, -1.5, 0.3]]),
)  # fmt: skip
"""A room in which every direction has a wall that tells the motion along it."""
WORLD = World("room", ROOM, Pose(0.0, 0.0, 0.0))


def weaving(now_s):
    """Return quick changes of the steering, as of a driver who corrects."""
    return 0.0 if now_s < 1.5 else (0.25, -0.2, 0.0, -0.3, 0.3, 0.1)[int(now_s / 0.4) % 6]


def straight(now_s):
    """Return no steering at all."""
    return 0.0 * now_s


def recorded(
    vehicle=None, lidar=None, *, steering=weaving, speed_mps=1.5, duration_s=12.0, odometry=True, gain=1.0, stamps=True
):
    """Return the recording of a drive through ROOM. gain: reported over true speed."""
    car = Vehicle(vehicle or VehicleSettings(), Pose(0.0, 0.0, 0.0))
    lidar = lidar or LidarSettings(noise_std_m=0.005)
    rng, demands = np.random.default_rng(3), {}
    scans, ends_s, commands, poses = [], [], [], []
    for k in range(round(duration_s / STEP_S)):
        now_s = k * STEP_S
        wanted_mps = speed_mps if 0.5 <= now_s % 5.0 < 4.0 else 0.6
        demand = demands.setdefault(wanted_mps, SpeedDemand(wanted_mps))
        if k % 8 == 0:
            commands.append((now_s, wanted_mps, steering(now_s)))
            poses.append((now_s, car.x_m, car.y_m, car.yaw_rad, gain * car.speed_mps, 0.0, 0.0))
        car.step(STEP_S, demand, commands[-1][2])
        if (k + 1) % round(SCAN_S / STEP_S) == 0:
            ends_s.append(car.now_s)
            scans.append(scan(WORLD, car.pose, car.twist, car.now_s, rng, lidar) / 1000.0)
    first_s = np.array(ends_s) - lidar.sweep_s
    return Recording(
        "scan", np.array(ends_s) + 0.003, first_s if stamps else first_s[::-1],
        np.array(scans, np.float32), float(np.radians(lidar.first_deg)),
        float(np.radians((lidar.last_deg - lidar.first_deg) / (lidar.beams - 1))), 0.02, 30.0, SCAN_S,
        "planted", (), {"ackermann_cmd": CommandTrack(*np.array(commands).T)},
        OdometryTrack(*np.array(poses).T) if odometry else None,
    )  # fmt: skip
