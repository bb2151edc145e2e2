"""All estimates of one drive: the arcs with the car's own parts left out, then the delays, then the stops."""

import cmath
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wallride.runtime.calibration.arc_fit import Arc, ArcFit, AssumedCar, fit_arcs, within_ends
from wallride.runtime.calibration.delays import DelayFit, KnownMotion, fit_motor, fit_servo, middle_of_sweep_s
from wallride.runtime.calibration.near_parts import near_parts_m, seen_beams
from wallride.runtime.calibration.responses import Estimate, unidentified
from wallride.runtime.calibration.scan_motion import Shift, motion_of_scans
from wallride.runtime.calibration.stop_match import MAX_RANGE_M, measure_shift
from wallride.runtime.calibration.trace import MIN_WAY_M, STANDS_BELOW_MPS, Trace, find_stops, steering_between
from wallride.runtime.control.perception.geometry import Booleans, Floats

MIN_SPEED_MPS = 0.6
STEADY_S = 0.3
"""Time before a stop in which the speed is taken to be steady."""
STANDS_AFTER_S, LONGEST_S = 0.6, 3.0
"""Least and greatest time of a stop."""
MAX_DECELERATION_MPS2 = 15.0
MIN_STOPS = 2


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredArcs:
    """fit: of speed, steering and the lidar's pose. part_m: (beams,), ranges of own parts, inf without one."""

    fit: ArcFit
    part_m: Floats

    @property
    def ignored(self) -> Booleans:
        """Return the beams that see the car itself."""
        return seen_beams(self.part_m)


def measure_arcs(trace: Trace, assumed: AssumedCar) -> MeasuredArcs:
    """Return what a drive with stops tells; `ArcFit` says why where it does not."""
    part_m = near_parts_m(trace.ranges_m, trace.kind)
    ignored = seen_beams(part_m)
    stops, arcs = find_stops(trace), []
    for before, after in pairwise(stops):
        way_m = after.distance_m - before.distance_m
        if abs(way_m) < MIN_WAY_M:
            continue
        shift = measure_shift(trace, before, after, ignored)
        if shift is not None:
            arcs.append(Arc(way_m, steering_between(trace, before, after), shift))
    return MeasuredArcs(fit_arcs(within_ends(arcs), assumed), part_m)


def measure_forward(trace: Trace, lidar_m: tuple[float, float]) -> tuple[float, float] | None:
    """Return how far [m] and whereto [rad, 0 is ahead, left positive] the scans go on the first way forward.

    Forward is what the motor reports; None where nothing tells. Where the scans do not tell what is aside, as before a
    single wall, it is ahead or backward. lidar_m: its place, ahead and to the left.
    """
    for before, after in pairwise(find_stops(trace)):
        if after.distance_m - before.distance_m > MIN_WAY_M:
            found = measure_shift(trace, before, after)
            if found is not None and found.std[0] < MIN_WAY_M / 2:
                moved_m = _moved_m(found.shift, lidar_m) * cmath.exp(-0.5j * found.shift[2])
                moved_m = moved_m if found.std[1] < MIN_WAY_M / 2 else complex(moved_m.real)
                return abs(moved_m), cmath.phase(moved_m)
    return None


def _moved_m(shift: Shift, lidar_m: tuple[float, float], yaw_rad: float = 0.0) -> complex:
    """Return how far the rear axle moved, x + iy, from how the lidar did. yaw_rad: by which the lidar is turned."""
    x_m, y_m, turn_rad = shift
    return complex(x_m, y_m) * cmath.exp(1j * yaw_rad) + complex(*lidar_m) * (1.0 - cmath.exp(1j * turn_rad))


def measure_locks(
    trace: Trace, arcs: MeasuredArcs, wheelbase_m: float, lidar_m: tuple[float, float]
) -> list[tuple[float, float]]:
    """Return the reported and the driven wheel angle of each way. lidar_m: its place, ahead and to the left."""
    yaw_rad, found = arcs.fit.lidar_yaw_rad, []
    for before, after in pairwise(find_stops(trace)):
        shift = measure_shift(trace, before, after, arcs.ignored)
        if shift is None or abs(after.distance_m - before.distance_m) < MIN_WAY_M:
            continue
        turn_rad = shift.shift[2]
        moved_m = _moved_m(shift.shift, lidar_m, 0.0 if yaw_rad.why else yaw_rad.value)
        chord_m = (moved_m * cmath.exp(-0.5j * turn_rad)).real
        curvature = turn_rad * np.sinc(turn_rad / np.pi / 2) / chord_m
        found.append((steering_between(trace, before, after), float(np.arctan(curvature * wheelbase_m))))
    return found


def measure_delays(trace: Trace, arcs: MeasuredArcs, rate_radps: float) -> tuple[DelayFit, DelayFit]:
    """Return delay and rate of servo and motor. rate_radps: of the commands."""
    fit = arcs.fit
    known = KnownMotion(abs(fit.wheelbase_m.value), abs(fit.speed_factor.value), rate_radps, arcs.ignored)
    return fit_servo(trace, known), fit_motor(trace)


def measure_braking(trace: Trace, arcs: MeasuredArcs, delay_s: float) -> Estimate:
    """Return the deceleration of the stops."""
    return fit_braking(trace, delay_s, arcs.ignored)


def fit_braking(trace: Trace, delay_s: float, ignored: Booleans | None = None) -> Estimate:
    """Return the mean deceleration [m/s2] of the stops in a drive; delay_s: of the motor.

    Way from the command to the standstill: v t + v^2 / (2 a).
    """
    found = [value for at_s in stops_from_speed(trace) if (value := _deceleration(trace, at_s, delay_s, ignored))]
    if len(found) < MIN_STOPS:
        return unidentified(f"{len(found)} stops from {MIN_SPEED_MPS} m/s; it needs {MIN_STOPS}")
    return _estimate(found)


def stops_from_speed(trace: Trace) -> list[float]:
    """Return the times of commands to stop that came while the car drove steadily."""
    at: list[float] = []
    for k in np.flatnonzero((trace.asked_mps[1:] == 0.0) & (np.abs(trace.asked_mps[:-1]) > MIN_SPEED_MPS)):
        at_s = float(trace.command_s[k + 1])
        before = (trace.motor_s > at_s - STEADY_S) & (trace.motor_s < at_s)
        if before.any() and np.abs(trace.speed_mps[before]).min() > MIN_SPEED_MPS:
            at.append(at_s)
    return at


def _deceleration(trace: Trace, at_s: float, delay_s: float, ignored: Booleans | None) -> float | None:
    reported_s = trace.motor_s[(trace.motor_s > at_s) & (np.abs(trace.speed_mps) < STANDS_BELOW_MPS)]
    stands_s = max(at_s + STANDS_AFTER_S, float(reported_s.min(initial=at_s + LONGEST_S)))
    part = trace.between(at_s - STEADY_S, stands_s + 0.6)
    if len(part.scan_s) < 8:
        return None
    ranges_m = part.ranges_m if ignored is None else np.where(ignored, np.nan, part.ranges_m)
    times_s = middle_of_sweep_s(part)
    motion = motion_of_scans(times_s, ranges_m, part.kind, MAX_RANGE_M)
    along_m = _along(motion.x_m, motion.y_m)
    steady, stands = times_s < at_s + delay_s, times_s > stands_s
    if np.count_nonzero(steady) < 3 or not stands.any():
        return None
    speed_mps, begin_m = np.polyfit(times_s[steady] - at_s, along_m[steady], 1)
    way_m = float(np.median(along_m[stands]) - begin_m) - speed_mps * delay_s
    if speed_mps < MIN_SPEED_MPS or way_m < speed_mps**2 / (2 * MAX_DECELERATION_MPS2):
        return None
    return float(speed_mps**2 / (2 * way_m))


def _along(x_m: Floats, y_m: Floats) -> Floats:
    """Return the way along the straight line of the drive."""
    end = np.hypot(x_m[-1], y_m[-1])
    along: Floats = (x_m * x_m[-1] + y_m * y_m[-1]) / max(float(end), 1e-9)
    return along


def _estimate(found: Sequence[float]) -> Estimate:
    """Return the harmonic mean, since ways are what varies evenly, with the interval of the mean."""
    ways = 1.0 / np.array(found)
    std = float(np.std(ways, ddof=1) / np.sqrt(ways.size))
    mean = float(ways.mean())
    return Estimate(1.0 / mean, 1.0 / (mean + 2.0 * std), 1.0 / max(mean - 2.0 * std, 1e-3))
