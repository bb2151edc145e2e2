"""Speed of a car without a tachometer, from its scans alone. Pure.

Each scan's displacement since a key scan, one a little while back, is taken for a measurement of the way along the
car, as uncertain as the walls leave it; a Kalman filter of way and speed, with an acceleration that is noise, makes a
speed of it. Between parallel walls without an end or a door no displacement tells the way: the spread grows until one
does.

The driver of a slow lidar takes the car's motion out of a turn, by this very estimate. An error of it would come back
as a way that was driven, and grow: so each scan is corrected anew by the speed that was taken out of its key.
"""

import cmath
import math
from dataclasses import replace
from typing import Final

import numpy as np

from wallride.drivers.api import Correction, MotorState, Scan
from wallride.drivers.pwm.speed import EstimatedSpeed
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.scan_displacement import (
    Displacement,
    Patches,
    corrected_anew,
    displacement,
    patches_of,
)
from wallride.runtime.control.vehicle import CarSettings

KEY_M, KEY_RAD, KEY_S = 0.5, 0.3, 0.6
"""Maximum way, turn and age of a key; a faster car has a new one with each scan."""
GAP_S: Final = 0.5
"""Gap between scans after which all begins anew."""
WAY_NOISE_M: Final = 0.008
"""Standard deviation of the way to a key beyond what the walls leave open: the scans' own times and steps."""
ACCELERATION: Final = 0.2
"""Spectral density of the acceleration [m2/s3]."""
UNKNOWN_MPS: Final = 2.0
"""Standard deviation of the speed that nothing tells."""
MISFIT: Final = 5.0
"""Standard deviations by which a measurement may differ; others are a scene that moves, and count for nothing."""
MAX_MISFITS: Final = 5
MIN_INFORMATION: Final = 1.0
"""Information [1/m2] that is added, so that an open direction is very uncertain, and not infinitely so."""


class ScanSpeed:
    """Learns scan by scan. estimate: the newest."""

    def __init__(self, car: CarSettings) -> None:
        self._car = car
        self.estimate = EstimatedSpeed(-math.inf, 0.0, math.inf)
        self._stamp_s = -math.inf
        self._key: Patches | None = None
        self._corrected_mps = self._curvature_per_m = 0.0
        self._begin_anew()

    def learn(self, scan: Scan, motor: MotorState | None) -> EstimatedSpeed:
        """Process one scan, in order; 0.3 to 0.5 ms. motor: tells the steering."""
        step_s = scan.stamp_s - self._stamp_s
        self._stamp_s = scan.stamp_s
        patches = patches_of(scan)
        if not 0.0 < step_s < GAP_S or self._key is None:
            self._begin_anew()
            self._take_key(patches, scan.correction)
        else:
            self._predict(step_s, motor.steering_rad if motor is not None else 0.0)
            found = self._displacement(self._key, self._like_the_key(patches, scan.correction))
            if found is not None:
                self._measure(found)
            self._key_s += step_s
            if abs(self._state[0]) > KEY_M or abs(self._turn_rad) > KEY_RAD or self._key_s > KEY_S or found is None:
                self._take_key(patches, scan.correction)
        spread_mps = math.sqrt(max(self._covariance[1, 1], 0.0))
        self.estimate = EstimatedSpeed(scan.stamp_s, float(self._state[1]), spread_mps)
        return self.estimate

    def _begin_anew(self) -> None:
        self._state: Floats = np.zeros(2)  # way since the key, speed
        self._covariance: Floats = np.diag((0.0, UNKNOWN_MPS**2))
        self._key_s = self._turn_rad = 0.0
        self._misfits = 0

    def _take_key(self, patches: Patches, done: Correction | None) -> None:
        """Count the way from this scan on."""
        self._key, self._key_s, self._turn_rad = patches, 0.0, 0.0
        if done is not None:
            self._corrected_mps = done.x_mps + done.yaw_rate_radps * self._car.lidar_y_m
        self._state[0] = 0.0
        self._covariance[0, :] = self._covariance[:, 0] = 0.0

    def _predict(self, step_s: float, steering_rad: float) -> None:
        moves = np.array(((1.0, step_s), (0.0, 1.0)))
        noise = ACCELERATION * np.array(((step_s**3 / 3, step_s**2 / 2), (step_s**2 / 2, step_s)))
        self._state = moves @ self._state
        self._covariance = moves @ self._covariance @ moves.T + noise
        if (share := UNKNOWN_MPS**2 / float(self._covariance[1, 1])) < 1.0:
            self._covariance[1, :] *= math.sqrt(share)  # both, so that way and speed stay consistent
            self._covariance[:, 1] *= math.sqrt(share)
        most_rad = self._car.max_steering_rad
        self._curvature_per_m = math.tan(min(max(steering_rad, -most_rad), most_rad)) / self._car.wheelbase_m
        self._turn_rad += float(self._state[1]) * step_s * self._curvature_per_m

    def _like_the_key(self, patches: Patches, done: Correction | None) -> Patches:
        """Return the patches as if their driver had known the speed that it took out of the key."""
        if done is None:
            return patches
        rate_radps = self._corrected_mps * self._curvature_per_m
        wanted_mps = self._corrected_mps + 1j * rate_radps * self._car.lidar_m
        return corrected_anew(patches, done, Correction(wanted_mps.real, wanted_mps.imag, rate_radps, done.ray_s))

    def _displacement(self, key: Patches, patches: Patches) -> Displacement | None:
        """Return the displacement since the key, looked for around the predicted one."""
        guess_m = cmath.rect(float(self._state[0]), self._turn_rad / 2)
        guess_m += self._car.lidar_m * (cmath.rect(1.0, self._turn_rad) - 1.0)
        there = replace(patches, middle_m=patches.middle_m + guess_m * cmath.rect(1.0, -self._turn_rad))
        found = displacement(key, there, self._turn_rad)
        if found is None:
            return None
        turned_m = guess_m * cmath.rect(1.0, found.turn_rad - self._turn_rad)
        return replace(found, shift_m=found.shift_m + turned_m)

    def _measure(self, found: Displacement) -> None:
        """Correct way and speed by the displacement since the key, less the lidar's swing about the rear axle."""
        self._turn_rad = found.turn_rad
        swung_m = self._car.lidar_m * (cmath.rect(1.0, found.turn_rad) - 1.0)
        along = cmath.rect(1.0, found.turn_rad / 2)
        way_m = ((found.shift_m - swung_m) * along.conjugate()).real
        direction = np.array((along.real, along.imag))
        open_m2 = direction @ np.linalg.inv(found.information + MIN_INFORMATION * np.eye(2)) @ direction
        variance = self._covariance[0, 0] + open_m2 + WAY_NOISE_M**2
        off_m = way_m - self._state[0]
        if off_m**2 > MISFIT**2 * variance and self._misfits < MAX_MISFITS:
            self._misfits += 1
            return
        self._misfits = 0
        gain = self._covariance[:, 0] / variance
        self._state = self._state + gain * off_m
        self._covariance = self._covariance - np.outer(gain, self._covariance[0, :])
