"""Regions without returns that are suspicious: no echo is no information, but most of it is only distance."""

import math
from typing import Any

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.perception.view import View

DARK_SHARE = 0.3
DARK_WINDOW_RAD = math.radians(10)


def _flat_dark(view: View, toward_rad: float, near_m: float) -> tuple[Any, ...]:
    scan = view.scan
    return view.no_echo, view.solid, view.ranges_m, scan.angle_min_rad, scan.angle_step_rad, toward_rad, near_m


@accelerated(flat=_flat_dark)
def find_dark_regions(view: View, toward_rad: float, near_m: float) -> bool:
    """Return whether over 30 % of the beams around a bearing lack an echo, with objects nearer than near_m beside them.

    No echo is no information. But in real corridors and halls the far end rarely returns an echo (6 to 64 % of all
    beams): a dark region between walls that are seen far beyond the stopping distance is depth; one that begins and
    ends near is a window, a black box or a blinded lidar.
    """
    no_echo, solid, ranges_m, angle_step_rad = view.no_echo, view.solid, view.ranges_m, view.scan.angle_step_rad
    middle = round((toward_rad - view.scan.angle_min_rad) / angle_step_rad)
    width = round(DARK_WINDOW_RAD / abs(angle_step_rad))
    first, last = max(0, middle - width), max(0, middle + width + 1)  # a negative one would count from the far end
    window = no_echo[first:last]
    if not window.size or np.count_nonzero(window) <= DARK_SHARE * window.size:
        return False
    dark = np.flatnonzero(window) + first
    right = np.flatnonzero(solid[: dark[0]])
    left = np.flatnonzero(solid[dark[-1] + 1 :]) + dark[-1] + 1
    if not right.size or not left.size:
        return False
    return bool(max(ranges_m[right[-1]], ranges_m[left[0]]) < near_m)
