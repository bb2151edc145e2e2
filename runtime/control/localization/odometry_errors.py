"""The errors of wheels, tyres and gyro, learnt from what scans show of the way between two of them.

Two scans up to KEY_M apart, each put into one moment, are laid over each other (`scan_displacement`). What the odometry
says of the way between them is wrong by the wheels' scale along the car, by the tyres' slip aside, and by scale and
bias of the gyro in the turn: four states of an extended Kalman filter. Where walls hide a direction, nothing is learnt
of it.

The slip follows no law that a car knows: with full drive or brake, and between two bends, it is wrong by half. On a
slippery floor that was most of the odometry's error. So the way aside itself is corrected, too.
"""

import cmath
import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from wallride.drivers.api import Correction, Scan
from wallride.runtime.control.localization.pose_filter import SLIP_S2PM
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.perception.motion.scan_matching import ScanPose
from wallride.runtime.control.perception.scan_displacement import (
    Displacement,
    Patches,
    corrected_anew,
    displacement,
    patches_of,
)

KEY_M, KEY_RAD, KEY_S = 0.8, 0.4, 5.0
"""Way, turn and age after which the newest scan becomes the key."""
COMPARED_M, COMPARED_RAD = 0.4, 0.2
"""Way and turn from one comparison to the next."""
FIRST_STD: Final = (0.05, 0.012, 0.01, 0.001)
WALK_STD: Final = (3e-4, 3e-4, 3e-5, 1e-4)
"""Standard deviations of wheels' scale, slip [s2/m], gyro's scale and bias [rad/s] at first, and of their changes from
one key to the next."""
MAPPED_STD: Final = 0.003
"""Standard deviation of the wheels' scale by a map."""
NOISE_M, NOISE_RAD = 0.008, 0.005
"""Standard deviations of a comparison beyond what the walls leave open: the scans' own times and steps."""
MIN_INFORMATION: Final = 1.0
"""Information [1/m2] that is added, so that an open direction is very uncertain, and not infinitely so."""
MISFIT, MOST_ASIDE_M = 4.0, 0.15
"""Standard deviations above which nothing is learnt from a comparison, and the largest correction aside: beyond them a
scene moves, or a place is taken for another."""
SLIDES_SHARE, SLIDES_RAD = 0.5, 0.01
"""Standard deviation of a way aside by the slip: a share of it, and an angle of the way ahead. Between two bends, with
full drive or brake, and near the limit of grip it is wrong by half."""
SCALE, SLIP, GYRO_SCALE, BIAS = range(4)


class Reckoned(NamedTuple):
    """A pose by dead reckoning, and what it has summed up. stamp_s: of it.

    gyro_rad: turn by the gyro, less its bias. by_slip: change of the way aside [m] for a change of the slip by 1 s2/m.
    """

    stamp_s: float
    pose: ScanPose
    gyro_rad: float = 0.0
    by_slip: float = 0.0


class AxleStep(NamedTuple):
    """What wheels and gyro report of a step: way [m], speed [m/s], turn [rad] less the gyro's bias, duration [s]."""

    way_m: float
    speed_mps: float
    turn_rad: float
    since_s: float


class _KeyScan(NamedTuple):
    patches: Patches
    at: Reckoned


class OdometryErrors:
    """The errors as they are known. state: (4,) true way over the reported one, slip, true turn over the gyro's, bias.

    The rear axle moves aside by slip * speed^2 * turn while that is little of the grip. bias [rad/s]: what is left of
    it after standing.
    """

    def __init__(self) -> None:
        self.state: Floats = np.array((1.0, SLIP_S2PM, 1.0, 0.0))
        self._covariance: Floats = np.diag(np.square(FIRST_STD))
        self._key: _KeyScan | None = None
        self._compared = Reckoned(-math.inf, ScanPose())
        self._aside_m2 = 0.0

    def know_scale(self, scale: float) -> None:
        """Take the scale of the wheels as a map tells it."""
        self.state[SCALE] = scale
        self._covariance[SCALE, :] = self._covariance[:, SCALE] = 0.0
        self._covariance[SCALE, SCALE] = MAPPED_STD**2

    def forget(self) -> None:
        """Forget the key: the way since is not known."""
        self._key = None

    def after(self, last: Reckoned, step: AxleStep) -> Reckoned:
        """Return where a step leads to."""
        scale, slip_s2pm, gyro_scale, bias_radps = self.state.tolist()
        gyro_rad = step.turn_rad - bias_radps * step.since_s
        turn_rad, way_m = gyro_scale * gyro_rad, scale * step.way_m
        by_slip = -((scale * step.speed_mps) ** 2) * turn_rad
        moved = ScanPose(complex(way_m, slip_s2pm * by_slip) * cmath.rect(1.0, 0.5 * turn_rad), turn_rad)
        return Reckoned(
            last.stamp_s + step.since_s, last.pose.placed(moved), last.gyro_rad + gyro_rad, last.by_slip + by_slip
        )

    def learn(self, scan: Scan, lidar_m: complex, speeds: tuple[float, float], here: Reckoned) -> Reckoned:
        """Compare a scan with the key; return the pose at the scan, `here`, corrected aside.

        lidar_m: place of the lidar in base_link, x + iy. speeds: the reported one [m/s] and the turn [rad/s].
        0.4 ms once in COMPARED_M, nothing for the scans between.
        """
        key = self._key
        if key is not None and 0.0 < here.stamp_s - key.at.stamp_s < KEY_S:
            since = here.pose.seen_from(self._compared.pose)
            if abs(since.at_m) < COMPARED_M and abs(since.yaw_rad) < COMPARED_RAD:
                return here
            patches = _at_one_moment(scan, self._lidar_motion(lidar_m, *speeds))
            moved = here.pose.seen_from(key.at.pose)
            found = _displacement(key.patches, patches, lidar_m, moved)
            far = abs(moved.at_m) > KEY_M or abs(moved.yaw_rad) > KEY_RAD
            if found is not None:
                here = self._measured(found, lidar_m, key.at, here, far=far)
            if found is not None and not far:
                self._compared = here
                return here
        else:
            patches = _at_one_moment(scan, self._lidar_motion(lidar_m, *speeds))
        self._key, self._compared, self._aside_m2 = _KeyScan(patches, here), here, 0.0
        return here

    def _lidar_motion(self, lidar_m: complex, reported_mps: float, turn_radps: float) -> tuple[complex, float]:
        """Return velocity [m/s] and turn [rad/s] of the lidar."""
        speed_mps = float(self.state[SCALE]) * reported_mps
        left_mps = -float(self.state[SLIP]) * speed_mps**2 * turn_radps
        return complex(speed_mps, left_mps) + 1j * turn_radps * lidar_m, turn_radps

    def _measured(self, found: Displacement, lidar_m: complex, key: Reckoned, here: Reckoned, *, far: bool) -> Reckoned:
        """Learn from a comparison, and return the pose corrected aside. far: as far as the key is compared with."""
        moved = here.pose.seen_from(key.pose)
        off_rad = found.turn_rad - moved.yaw_rad
        told_m = moved.at_m * cmath.rect(1.0, 0.5 * off_rad)
        ahead = cmath.rect(1.0, 0.5 * found.turn_rad)
        off_m = (found.shift_m - lidar_m * (cmath.rect(1.0, found.turn_rad) - 1.0) - told_m) / ahead
        open_m2 = np.linalg.inv(found.information + MIN_INFORMATION * np.eye(2))
        along, aside = (np.array((way.real, way.imag)) for way in (ahead, 1j * ahead))
        if far:
            self._learn(here, key, off_rad, (off_m.real, (told_m / ahead).real), along @ open_m2 @ along)
        variance_m2 = float(aside @ open_m2 @ aside) + NOISE_M**2
        by_slip = here.by_slip - self._compared.by_slip
        way_m = abs(here.pose.at_m - self._compared.pose.at_m)
        self._aside_m2 += (SLIDES_SHARE * by_slip * self.state[SLIP]) ** 2 + (SLIDES_RAD * way_m) ** 2
        self._take({SLIP: by_slip}, off_m.imag, variance_m2 + self._aside_m2)
        gain = self._aside_m2 / (self._aside_m2 + variance_m2)
        self._aside_m2 *= 1.0 - gain
        if abs(off_m.imag) > MOST_ASIDE_M:
            return here
        step_m = 1j * gain * off_m.imag * ahead * cmath.rect(1.0, key.pose.yaw_rad)
        return here._replace(pose=ScanPose(here.pose.at_m + step_m, here.pose.yaw_rad))

    def _learn(
        self, here: Reckoned, key: Reckoned, off_rad: float, along_m: tuple[float, float], open_m2: float
    ) -> None:
        """Learn the scales and the bias. along_m: error of the way from the key, and that way."""
        self._covariance = self._covariance + np.diag(np.square(WALK_STD))
        by_bias = -float(self.state[GYRO_SCALE]) * (here.stamp_s - key.stamp_s)
        self._take({GYRO_SCALE: here.gyro_rad - key.gyro_rad, BIAS: by_bias}, off_rad, NOISE_RAD**2)
        self._take({SCALE: along_m[1] / float(self.state[SCALE])}, along_m[0], open_m2 + NOISE_M**2)

    def _take(self, slopes: dict[int, float], off: float, variance: float) -> None:
        """Correct the states by what a measurement is off, which changes with them by the slopes."""
        slope = np.zeros(4)
        slope[list(slopes)] = list(slopes.values())
        spread = self._covariance @ slope
        total = float(slope @ spread) + variance
        if off * off < MISFIT**2 * total:
            self.state = self.state + spread * (off / total)
            self.state[SLIP] = max(self.state[SLIP], 0.0)
            self._covariance = self._covariance - np.outer(spread, spread) / total


def _at_one_moment(scan: Scan, motion: tuple[complex, float]) -> Patches:
    """Return the patches of a scan as they were if all beams had been measured at its stamp. motion: of the lidar."""
    lidar_mps, turn_radps = motion
    done = scan.correction or Correction(0.0, 0.0, 0.0, scan.ray_s)
    return corrected_anew(patches_of(scan), done, Correction(lidar_mps.real, lidar_mps.imag, turn_radps, done.ray_s))


def _displacement(key: Patches, patches: Patches, lidar_m: complex, moved: ScanPose) -> Displacement | None:
    """Return how the lidar moved since the key, looked for around the way of the rear axle by odometry."""
    guess_m = moved.at_m + lidar_m * (cmath.rect(1.0, moved.yaw_rad) - 1.0)
    there = replace(patches, middle_m=patches.middle_m + guess_m * cmath.rect(1.0, -moved.yaw_rad))
    found = displacement(key, there, moved.yaw_rad)
    if found is None:
        return None
    return replace(found, shift_m=found.shift_m + guess_m * cmath.rect(1.0, found.turn_rad - moved.yaw_rad))
