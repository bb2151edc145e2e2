"""Simulated scans of a UST-10LX: 1081 integers, in mm, with the sensor's faults and noise.

Facts: Hokuyo UST-10LX (270 degrees, 0.25 degrees apart, 40 Hz, step 0 at the right rear, counter-clockwise), and the
recordings of RACECARs: 65533 for "no return", returns far beyond the 10 m of the data sheet, and 7 to 31 beams at the
right rear that see the car itself at 0.03 to 0.15 m.
"""

import cmath
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from wallride.drivers.section import Section
from wallride.sim.world.own_parts import OWN_PARTS, profile, seen_with_parts
from wallride.sim.world.place import Surroundings
from wallride.sim.world.pose import STANDING, Booleans, Floats, Pose, Twist

Millimetres = npt.NDArray[np.int64]
Complexes = npt.NDArray[np.complex128]
Share = Annotated[float, Field(ge=0, le=1)]

NO_RETURN_MM = 65533
SELF_RETURN_BEAMS = 19
_TURN_DEG = 360.0


class LidarSettings(Section):
    """Mount, scan pattern and faults of the lidar.

    mount_x_m, mount_y_m: its position ahead of the rear axle and left of the middle line. mount_yaw_rad: turned to the
        left by this angle.
    first_deg, last_deg: first and last beam, both measured; counter-clockwise, 0 ahead.
    range_max_m: returns from farther away are lost. The data sheet promises 10 m; real ones report up to 30.
    noise_std_m: standard deviation of every distance.
    outlier_share: beams that report a distance between 0.02 and 10 m that is unrelated to the world.
    dropout_share: beams that report no return.
    dirty_sectors: (from_deg, to_deg, range_m), dirt on the window: these beams see nothing beyond range_m.
    self_returns: a part of the car at the right rear, within its outline. own_parts: further ones, by the names of
        `wallride.sim.world.own_parts`, which hide what is behind them.
    motion_skew: each beam is measured at its own moment of the sweep; off: all at its end.
    """

    mount_x_m: Annotated[float, Field(ge=-1, le=1)] = 0.27
    mount_y_m: Annotated[float, Field(ge=-1, le=1)] = 0.0
    mount_yaw_rad: Annotated[float, Field(ge=-3.15, le=3.15)] = 0.0
    beams: Annotated[int, Field(ge=2, le=10_000)] = 1081
    first_deg: Annotated[float, Field(ge=-180, lt=180)] = -135.0
    last_deg: Annotated[float, Field(gt=-180, le=180)] = 135.0
    rate_hz: Annotated[float, Field(gt=0, le=1000)] = 40.0
    range_max_m: Annotated[float, Field(gt=0, le=65)] = 30.0
    noise_std_m: Annotated[float, Field(ge=0, le=1)] = 0.01
    outlier_share: Share = 0.0
    dropout_share: Share = 0.0
    dirty_sectors: tuple[tuple[float, float, Annotated[float, Field(gt=0)]], ...] = ()
    self_returns: bool = False
    own_parts: str = "none"
    motion_skew: bool = True

    @model_validator(mode="after")
    def _turns_left(self) -> Self:
        if self.last_deg <= self.first_deg:
            raise ValueError(f"last_deg {self.last_deg} must be above first_deg {self.first_deg}: beams go to the left")
        return self

    @field_validator("own_parts")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in OWN_PARTS:
            raise ValueError(f"write one of {', '.join(OWN_PARTS)}")
        return kind

    @property
    def sweep_s(self) -> float:
        """Return the time from the first beam to the last: 18.75 ms of the UST-10LX's 25 ms."""
        return (self.last_deg - self.first_deg) / _TURN_DEG / self.rate_hz

    @property
    def ray_s(self) -> float:
        """Return the time from one beam to the next, as a driver tells it."""
        return self.sweep_s / (self.beams - 1) if self.motion_skew else 0.0


def scan(
    surroundings: Surroundings,
    pose: Pose,
    twist: Twist,
    now_s: float,
    rng: np.random.Generator,
    settings: LidarSettings | None = None,
) -> Millimetres:
    """Return one sweep as the sensor reports it, shape (beams,), in mm; 65533 for no return.

    pose, twist: the rear axle's at the end of the sweep, now_s; earlier beams are traced back along the motion. Moving
    obstacles are taken at their present places.
    """
    if not math.isfinite(now_s):
        raise ValueError(f"a scan needs a finite time, not {now_s}")
    lidar = settings or LidarSettings()
    ranges_m = true_ranges_m(surroundings, pose, twist, lidar)
    return _as_reported(ranges_m, lidar, rng)


def sector(
    surroundings: Surroundings, pose: Pose, bearing_rad: Floats, start_m: Complexes, rng: np.random.Generator,
    lidar: LidarSettings,
) -> Millimetres:  # fmt: skip
    """Return the lengths of any rays as the sensor reports them, shape (n,), in mm; 65533 for no return.

    bearing_rad: from the sensor's zero. start_m: where they begin, x + iy, at its middle. All at one moment: a turning
    head is asked often. Self-returns and own parts are not in it.
    """
    at, yaw_rad = pose.ahead(lidar.mount_x_m, lidar.mount_y_m), pose.yaw_rad + lidar.mount_yaw_rad
    start = complex(at.x_m, at.y_m) + start_m * cmath.rect(1.0, yaw_rad)
    seen_m = surroundings.cast(start.real, start.imag, bearing_rad + yaw_rad)
    bearing_deg = np.degrees((bearing_rad + math.pi) % math.tau - math.pi)
    noise_m = rng.normal(0.0, lidar.noise_std_m, seen_m.size) if lidar.noise_std_m else 0.0
    return _reported_mm(np.minimum(seen_m, _dirt_m(bearing_deg, lidar)), noise_m, lidar, rng)


def true_ranges_m(surroundings: Surroundings, pose: Pose, twist: Twist, lidar: LidarSettings) -> Floats:
    """Return the ranges of a perfect lidar in the same place, shape (beams,); inf where there is nothing."""
    fan = _fan(lidar)
    if not lidar.motion_skew or twist == STANDING:
        at = pose.ahead(lidar.mount_x_m, lidar.mount_y_m)
        return surroundings.cast(at.x_m, at.y_m, fan.bearing_rad + (pose.yaw_rad + lidar.mount_yaw_rad))
    # In complex numbers, x + iy: a short arc is as long as its chord, to 1e-4, and points half-way between its ends.
    half_way = _evenly_turned(-twist.yaw_rate_radps * lidar.sweep_s / 2, lidar.beams)
    heading = cmath.rect(1.0, pose.yaw_rad) * half_way
    place = fan.ago_s * heading
    place *= -complex(twist.speed_mps, twist.lateral_mps)
    place += complex(pose.x_m, pose.y_m)
    heading *= half_way
    heading *= complex(lidar.mount_x_m, lidar.mount_y_m) if lidar.mount_y_m else lidar.mount_x_m
    place += heading
    yaw_rad = (pose.yaw_rad + lidar.mount_yaw_rad) - twist.yaw_rate_radps * fan.ago_s
    return surroundings.cast(place.real, place.imag, fan.bearing_rad + yaw_rad)


def _evenly_turned(from_rad: float, count: int) -> Complexes:
    """Return exp(i angle), shape (count,), for angles that go evenly from `from_rad` to 0; `count` is 2 at least.

    Each index is split into two digits: few exponentials and one product per beam, instead of an exponential per beam.
    """
    step_rad = -from_rad / (count - 1)
    base = math.isqrt(count - 1) + 1
    small = np.arange(base)
    coarse, fine = np.exp(1j * (from_rad + base * step_rad * small)), np.exp(1j * step_rad * small)
    return np.outer(coarse, fine).ravel()[:count]


@dataclass(frozen=True, slots=True, eq=False)
class _Fan:
    """Per beam: bearing from straight ahead, time before the sweep's end, and maximum range through dirt."""

    bearing_rad: Floats
    ago_s: Floats
    dirt_m: Floats
    own_parts_m: Floats


@lru_cache(maxsize=16)
def _fan(lidar: LidarSettings) -> _Fan:
    bearing_deg = np.linspace(lidar.first_deg, lidar.last_deg, lidar.beams)
    own_m = np.full(lidar.beams, np.inf)
    if lidar.self_returns:
        own = np.arange(min(SELF_RETURN_BEAMS, lidar.beams))
        own_m[own] = 0.09 + 0.05 * np.sin(0.7 * own)  # a rough part of the car, not a smooth one
    ago_s = np.linspace(lidar.sweep_s, 0.0, lidar.beams)
    return _Fan(np.radians(bearing_deg), ago_s, _dirt_m(bearing_deg, lidar), own_m)


def _dirt_m(bearing_deg: Floats, lidar: LidarSettings) -> Floats:
    dirt_m = np.full(bearing_deg.size, np.inf)
    for from_deg, to_deg, range_m in lidar.dirty_sectors:
        hidden = (bearing_deg >= from_deg) & (bearing_deg <= to_deg)
        dirt_m[hidden] = np.minimum(dirt_m[hidden], range_m)
    return dirt_m


def _as_reported(ranges_m: Floats, lidar: LidarSettings, rng: np.random.Generator) -> Millimetres:
    """Add the sensor's noise and faults. Draws the same random numbers whatever is hit: one seed, one noise."""
    fan = _fan(lidar)
    noise_m = rng.normal(0.0, lidar.noise_std_m, lidar.beams) if lidar.noise_std_m else 0.0
    seen_m = np.minimum(ranges_m, fan.dirt_m) if lidar.dirty_sectors else ranges_m
    silent: Booleans | None = None
    if lidar.own_parts != "none":
        parts = profile(lidar.own_parts, lidar.first_deg, lidar.last_deg, lidar.beams)
        seen_m, silent = seen_with_parts(seen_m, parts, rng, lidar.range_max_m)
    return _reported_mm(seen_m, noise_m, lidar, rng, silent, fan.own_parts_m if lidar.self_returns else None)


def _reported_mm(
    seen_m: Floats, noise_m: Floats | float, lidar: LidarSettings, rng: np.random.Generator,
    silent: Booleans | None = None, own_m: Floats | None = None,
) -> Millimetres:  # fmt: skip
    lost = seen_m > lidar.range_max_m
    seen_m = np.minimum(seen_m, lidar.range_max_m)  # lost beams report nothing; this keeps them finite
    seen_m += noise_m
    if lidar.outlier_share:
        wild = rng.random(seen_m.size) < lidar.outlier_share
        seen_m = np.where(wild, rng.uniform(0.02, min(10.0, lidar.range_max_m), seen_m.size), seen_m)
        lost &= ~wild
    if silent is not None:
        lost |= silent
    if lidar.dropout_share:
        lost |= rng.random(seen_m.size) < lidar.dropout_share
    if own_m is not None:
        own = np.isfinite(own_m)
        seen_m = np.where(own, np.clip(own_m + 0.2 * noise_m, 0.03, 0.15), seen_m)
        lost &= ~own
    np.maximum(seen_m, 0.0, out=seen_m)
    seen_m *= 1000.0
    reported_mm = np.rint(seen_m, out=seen_m).astype(np.int64)
    if lost.any():
        reported_mm[lost] = NO_RETURN_MM
    return reported_mm
