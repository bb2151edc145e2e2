"""Scans of a lidar of 1081 beams over 270 degrees, and what a car of usual size sees in them."""

import numpy as np

from wallride.drivers.api import Scan
from wallride.runtime.control.perception.view import ViewCache
from wallride.runtime.control.vehicle import CarSettings
from wallride.sim.virtual.devices import BEAMS, STEP_RAD

CAR = CarSettings()
MIDDLE = BEAMS // 2
BEARING_RAD = STEP_RAD * (np.arange(BEAMS) - MIDDLE)
SCAN_S = 0.025


def scan_of(ranges_m, stamp_s=0.0, number=0, *, late_s=0.0, from_m=0.02, to_m=30.0):
    """Return a scan; late_s: how much later than at its stamp it came, from_m, to_m: what the lidar measures."""
    ranges_m = np.asarray(ranges_m, np.float32)
    return Scan(stamp_s, stamp_s + late_s, -STEP_RAD * MIDDLE, STEP_RAD, from_m, to_m, ranges_m, number)


def see(ranges_m, **more):
    return ViewCache(CAR).see(scan_of(ranges_m, **more))
