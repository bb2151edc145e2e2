"""Rooms drawn in cells, with the scans of a standing lidar in them."""

import math
from dataclasses import replace

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.localization.wall_points import MapCells
from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.pose import Pose

CELL_M = 0.05
FIRST_RAD, STEP_RAD, BEAMS = math.radians(-135.0), math.radians(0.25), 1081
LIDAR_M = 0.27


class Room:
    """Free rectangles (x0, y0, x1, y1) [m] in solid ground, and solid boxes in these."""

    def __init__(self, free, boxes=(), size_m=(16.0, 12.0), corner_m=(-2.0, -3.0)):
        shape = round(size_m[1] / CELL_M), round(size_m[0] / CELL_M)
        self.free = np.zeros(shape, dtype=bool)
        self.corner_m = corner_m
        for part in free:
            self.free[self._cells(part)] = True
        for part in boxes:
            self.free[self._cells(part)] = False
        self.cells = MapCells(~self.free, self.free, CELL_M, complex(*corner_m))
        self.geometry = GridGeometry(~self.free, CELL_M, Pose(corner_m[0], corner_m[1], 0.0))

    def scan(self, pose, *, stamp_s=0.0, noise_m=0.0, seed=0, number=0, keep=None):
        """Return the scan from a pose of the rear axle, (x, y, yaw); keep: beams that have a distance."""
        x_m, y_m, yaw_rad = pose
        bearings = FIRST_RAD + STEP_RAD * np.arange(BEAMS) + yaw_rad
        at = x_m + LIDAR_M * math.cos(yaw_rad), y_m + LIDAR_M * math.sin(yaw_rad)
        ranges_m = self.geometry.cast(*at, bearings) + np.random.default_rng(seed).normal(0.0, noise_m, BEAMS)
        if keep is not None:
            ranges_m = np.where(keep, ranges_m, np.nan)
        return Scan(stamp_s, stamp_s, FIRST_RAD, STEP_RAD, 0.02, 30.0, ranges_m.astype(np.float32), number)

    def _cells(self, part):
        columns = [round((x_m - self.corner_m[0]) / CELL_M) for x_m in part[::2]]
        rows = [round((y_m - self.corner_m[1]) / CELL_M) for y_m in part[1::2]]
        return slice(*rows), slice(*columns)


BOXES = [(4.0, -1.0, 4.6, -0.5), (10.4, 4.0, 11.0, 5.2)]
"""Furniture that breaks the symmetry of the ring."""


def ring(boxes=()):
    """A corridor 2 m wide round a block of 8 x 4 m; without boxes it is symmetric by half a turn."""
    return Room([(-1.0, -1.0, 11.0, 7.0)], [(1.0, 1.0, 9.0, 5.0), *boxes])


def corridor():
    """A corridor 2 m wide and 60 m long, closed at the right end, 55 m ahead."""
    return Room([(-5.0, -1.0, 55.0, 1.0)], size_m=(66.0, 6.0), corner_m=(-8.0, -3.0))


def among_people(scan, nearer_than_m=0.5):
    """Return a scan in which people are near over half of the view."""
    legs = np.arange(BEAMS) // 80 % 2 == 0
    return replace(scan, ranges_m=np.where(legs, np.minimum(scan.ranges_m, nearer_than_m), scan.ranges_m))


def report(stamp_s, way_m=0.0, speed_mps=0.0, steering_rad=0.0):
    """Return a report of the wheels."""
    return MotorState(stamp_s, speed_mps, way_m, steering_rad)
