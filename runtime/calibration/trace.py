"""A recorded drive from standstill to standstill: its stops, and what lay between them.

All measurements of a place are made while the car stands: many scans of one place average their noise, and a sweep that
does not move is not distorted.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.runtime.calibration.scan_motion import Kind
from wallride.runtime.control.perception.geometry import Booleans, Floats, bearings_rad

STANDS_BELOW_MPS = 0.01
SETTLED_S = 0.3
"""Time after the last report of a motion in which the car still rocks."""
MIN_STAND_SCANS = 6
MIN_SHARE = 0.5
"""Minimum share of a stop's scans in which a beam returns."""
DRIVES_ABOVE_MPS = 0.1
MIN_WAY_M = 0.1
AHEAD_RAD = np.radians(25.0)
NEAR_BEAMS = 20
"""Number of returns that make a thing ahead: outliers are fewer."""


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """Scans, motor reports and commands of one drive, each with its times [s] on one clock.

    scan_s: (n,), end of each sweep; it takes sweep_s. ranges_m: (n, beams), NaN without a return. kind: of the lidar.
    motor_s, distance_m, speed_mps, steering_rad: (m,), as reported. command_s, asked_mps, asked_rad: (k,), as sent to
    the motor.
    """

    kind: Kind
    sweep_s: float
    scan_s: Floats
    ranges_m: npt.NDArray[np.floating[Any]]
    motor_s: Floats
    distance_m: Floats
    speed_mps: Floats
    steering_rad: Floats
    command_s: Floats
    asked_mps: Floats
    asked_rad: Floats

    def between(self, from_s: float, to_s: float) -> "Trace":
        """Return the part of the drive between two times."""
        scans, motor, commands = (
            (times_s >= from_s) & (times_s <= to_s) for times_s in (self.scan_s, self.motor_s, self.command_s)
        )
        return Trace(
            self.kind, self.sweep_s, self.scan_s[scans], self.ranges_m[scans], self.motor_s[motor],
            self.distance_m[motor],
            self.speed_mps[motor], self.steering_rad[motor], self.command_s[commands], self.asked_mps[commands],
            self.asked_rad[commands],
        )  # fmt: skip


@dataclass(slots=True, eq=False)
class TraceBuilder:
    """Collects a drive. kind, sweep_s, period_s: of the lidar, known from its first scans on."""

    kind: Kind = (0.0, 0.0, 0)
    sweep_s: float = 0.0
    period_s: float = 0.025
    scans: list[tuple[float, npt.NDArray[np.floating[Any]]]] = field(default_factory=list)
    motor: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Time, distance, speed, steering."""
    commands: list[tuple[float, float, float]] = field(default_factory=list)
    """Time, speed, steering."""

    def nearest_ahead_m(self) -> float:
        """Return the range of the nearest thing ahead in the newest scan; inf without one."""
        if not self.scans:
            return float("inf")
        ranges_m = self.scans[-1][1][np.abs(bearings_rad(*self.kind)) < AHEAD_RAD]
        near_m = np.sort(ranges_m[np.isfinite(ranges_m)])
        return float(near_m[NEAR_BEAMS - 1]) if near_m.size >= NEAR_BEAMS else float("inf")

    def trace(self) -> Trace:
        """Return what was collected so far."""
        motor, commands = np.array(self.motor).reshape(-1, 4), np.array(self.commands).reshape(-1, 3)
        ranges_m = np.array([ranges_m for _, ranges_m in self.scans]).reshape(len(self.scans), self.kind[2])
        times_s = np.array([at_s for at_s, _ in self.scans])
        return Trace(self.kind, self.sweep_s, times_s, ranges_m, *motor.T, *commands.T)


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """A standstill from from_s to to_s. ranges_m: (beams,), median of its scans; NaN where a beam seldom returns."""

    from_s: float
    to_s: float
    distance_m: float
    ranges_m: Floats


def find_stops(trace: Trace) -> list[Stop]:
    """Return the standstills in which enough scans were taken, in order."""
    stands = np.abs(trace.speed_mps) < STANDS_BELOW_MPS
    edges = np.flatnonzero(np.diff(np.concatenate([[0], stands.astype(int), [0]])))
    found = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        from_s = float(trace.motor_s[first]) + (SETTLED_S if first else 0.0)
        to_s = float(trace.motor_s[end - 1])
        scans = trace.ranges_m[(trace.scan_s >= from_s) & (trace.scan_s <= to_s)]
        if len(scans) >= MIN_STAND_SCANS:
            found.append(Stop(from_s, to_s, float(trace.distance_m[end - 1]), median_ranges_m(scans)))
    return found


def median_ranges_m(scans: npt.NDArray[np.floating[Any]]) -> Floats:
    """Return each beam's median of scans (n, beams); NaN where fewer than half of them return."""
    ranges_m = scans.astype(np.float64)
    seldom: Booleans = np.count_nonzero(np.isfinite(ranges_m), axis=0) < MIN_SHARE * len(ranges_m)
    ranges_m[:, seldom] = 0.0
    median_m: Floats = np.nanmedian(ranges_m, axis=0)
    median_m[seldom] = np.nan
    return median_m


def steering_between(trace: Trace, before: Stop, after: Stop) -> float:
    """Return the steering angle of the way between two stops, as reported; NaN where the car did not drive."""
    moving = (trace.motor_s > before.to_s) & (trace.motor_s < after.from_s)
    moving &= np.abs(trace.speed_mps) > DRIVES_ABOVE_MPS
    return float(np.median(trace.steering_rad[moving])) if moving.any() else float("nan")
