"""Motion of the scene compared with the wheels: wheels that turn in the air, or spin against an obstacle, move nothing.

A scan is compared with one that was taken, by odometry, some centimetres back. Of the beams for which it makes a
difference, most see the older scan carried along when the car moves, and the older scan itself when it stands. Only far
returns are used: dirt and the car's own parts are stationary whatever the car does.
"""

import cmath
from dataclasses import dataclass

import numpy as np

from wallride.runtime.control.perception.geometry import Floats, Places
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import View

EVERY_M, EVERY_RAD = 0.09, 0.1
FROM_M, WITHIN_M = 1.0, 8.0
EVERY_BEAM = 4
DIFFERS_M = 0.12
SAME_M = 0.06
"""Maximum difference of equal ranges: three standard deviations of a noisy lidar (0.02 m)."""
FEWEST = 16
STANDING_SHARE = 0.7
"""Minimum number of distinguishing beams, and the minimum share of them that must see the older scan unmoved."""


@dataclass(frozen=True, slots=True, eq=False)
class _Keyframe:
    """An earlier scan: its ranges (n,), its far places (m,) in odom, and its pose."""

    ranges_m: Floats
    places: Places
    pose: OdometryState


class SceneMotion:
    """Compares scans that are EVERY_M or EVERY_RAD apart by odometry; `update` once per scan.

    stands: whether the scene stood still while the wheels turned, at the last comparison.
    moved: result of this scan: True, it moves, or there is no contrary evidence; False, it stands; None, not yet known.
    """

    def __init__(self, lidar_m: complex) -> None:
        self._lidar_m = lidar_m
        self._key: _Keyframe | None = None
        self.stands = False
        self.moved: bool | None = None

    def update(self, view: View, pose: OdometryState) -> None:
        """Process one scan and its pose by odometry."""
        key, self.moved = self._key, None
        if key is not None and key.ranges_m.shape == view.ranges_m.shape:
            moved_m = abs(complex(pose.x_m - key.pose.x_m, pose.y_m - key.pose.y_m))
            if moved_m < EVERY_M and abs(pose.yaw_rad - key.pose.yaw_rad) < EVERY_RAD:
                return
            self.stands = self._stands(key, view, pose)
            self.moved = not self.stands
        turned, at_m = self._lidar(pose)
        far = np.flatnonzero((view.ranges_m > FROM_M) & (view.ranges_m < WITHIN_M))[::EVERY_BEAM]
        places = view.ranges_m[far] * np.exp(1j * view.bearing_rad[far]) * turned + at_m
        self._key = _Keyframe(view.ranges_m, places, pose)

    def _stands(self, key: _Keyframe, view: View, pose: OdometryState) -> bool:
        turned, at_m = self._lidar(pose)
        seen = (key.places - at_m) * turned.conjugate()
        scan = view.scan
        beam = np.rint((np.angle(seen) - scan.angle_min_rad) / scan.angle_step_rad).astype(np.intp)
        inside = (beam >= 0) & (beam < view.ranges_m.size)
        beam, carried_m = beam[inside], np.abs(seen[inside])
        before_m, now_m = key.ranges_m[beam], view.ranges_m[beam]
        tells = np.abs(carried_m - before_m) > DIFFERS_M  # NaN, no echo, tells nothing
        stood = tells & (np.abs(now_m - before_m) < SAME_M)
        count = int(np.count_nonzero(tells & ~np.isnan(now_m)))
        return count >= FEWEST and int(np.count_nonzero(stood)) > STANDING_SHARE * count

    def _lidar(self, pose: OdometryState) -> tuple[complex, complex]:
        turned = cmath.rect(1.0, pose.yaw_rad)
        return turned, complex(pose.x_m, pose.y_m) + self._lidar_m * turned
