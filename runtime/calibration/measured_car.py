"""All estimates of one drive: the arcs with the car's own parts left out, then the delays, then the stops."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wallride.runtime.calibration.arc_fit import Arc, ArcFit, AssumedCar, fit_arcs, within_ends
from wallride.runtime.calibration.braking import fit_braking
from wallride.runtime.calibration.delays import DelayFit, KnownMotion, fit_motor, fit_servo
from wallride.runtime.calibration.near_parts import near_parts_m, seen_beams
from wallride.runtime.calibration.responses import Estimate
from wallride.runtime.calibration.stop_match import measure_shift
from wallride.runtime.calibration.trace import MIN_WAY_M, Trace, find_stops, steering_between
from wallride.runtime.control.perception.geometry import Booleans, Floats


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


def measure_forward_m(trace: Trace) -> float | None:
    """Return how far the lidar went forward on a way that the motor reports as forward; None where nothing tells."""
    stops = find_stops(trace)
    for before, after in pairwise(stops):
        if after.distance_m - before.distance_m > MIN_WAY_M:
            found = measure_shift(trace, before, after)
            if found is not None and found.std[0] < MIN_WAY_M / 2:
                return found.shift[0]
    return None


def measure_locks(
    trace: Trace, ignored: Booleans, wheelbase_m: float, lidar_m: tuple[float, float]
) -> list[tuple[float, float]]:
    """Return the reported and the driven wheel angle of each way. lidar_m: its place, ahead and to the left."""
    found = []
    for before, after in pairwise(find_stops(trace)):
        shift = measure_shift(trace, before, after, ignored)
        if shift is None or abs(after.distance_m - before.distance_m) < MIN_WAY_M:
            continue
        x_m, y_m, turn_rad = shift.shift
        cos, sin = np.cos(turn_rad), np.sin(turn_rad)
        at_x = x_m + lidar_m[0] - cos * lidar_m[0] + sin * lidar_m[1]
        at_y = y_m + lidar_m[1] - sin * lidar_m[0] - cos * lidar_m[1]
        chord_m = at_x * np.cos(turn_rad / 2) + at_y * np.sin(turn_rad / 2)
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
