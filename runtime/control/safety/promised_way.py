"""A promised path as the way of a car: poses, speeds and headings, or the reason why no car can drive it.

The path is resampled to the steps of the sweep. Beyond its end the last curvature goes on, as the arc of wheels that
are held. The speed at a place is never taken for less than what the motor's own brake leaves of the present one, so
that no promise makes the car slower than it is. In a bend the nose points inward of the course by the rear axle's slip
(`footprint`).
"""

import cmath
import math
from typing import Any, Final, NamedTuple

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.drivers.value import value
from wallride.runtime.arbitration.promise import Promise
from wallride.runtime.control.perception.geometry import Floats, Places
from wallride.runtime.control.safety.footprint import MIN_SLEW_SPEED_MPS, STEP_M, AxlePath

MOTOR_BRAKE_MPS2 = 5.0
"""Deceleration that is counted on from a set speed that falls: a VESC ramps it by 5.4 m/s2."""
FASTER_MPS = 0.2
"""Error of the speed from which the motor accelerates."""
MAX_POINTS, MAX_MPS = 500, 100.0
MAX_GAP_M = 0.5
MIN_SPACING_M = 0.1
"""Distance of the points of which bearings are taken: of nearer ones they are noise."""
MAX_MARGIN_M = 0.5
HERE_M = 0.06
HERE_RAD = 0.4
"""Greatest distance of the path from the car, and angle from its heading where it begins: slip and a turn begun."""
WHEEL_SPARE_RAD = 0.08
"""Error of a wheels' angle read from a path: the tyres' understeer, the steering's trim, noise of the points."""
CORRECTS_RAD: Final = 0.15
"""Largest angle beside the path's own by which a fast source corrects itself: the wheels may just stand at it."""
GRIP_SPARE = 1.3
"""Share of the grip up to which a path is believed: its curvature is read from points. Above 1 the speed is limited."""
ROUNDING: Final = 1e-9
"""Part of a chord that is none: a corner of a path is the end of one chord and the begin of the next."""
AHEAD_M = 2.0
"""Part of a path in which the car looks for its own place."""

NO_NUMBERS = "its path is no numbers"
NOT_HERE = "its path does not begin at the car"
GAPS = "its path has gaps"
TOO_SHORT = "its path is shorter than a stop"
CANNOT_STEER = "no wheels steer so"
NO_GRIP = "faster than the floor's grip"
REFUSALS: Final = (GAPS, NOT_HERE, TOO_SHORT, CANNOT_STEER, NO_GRIP)
"""Reasons of `drive_promise`, by number."""


class Unbelievable(NamedTuple):
    """Why a promise is not believed."""

    reason: str


class Roadworthy(NamedTuple):
    """What the car can do, for one judgement of its way.

    speed_mps: now, >= 0. wheel_rad: angle of the wheels now. latency_s: until a new command acts. grip_mps2: of the
    assumed floor. slip_rad_per_mps2: angle by which the course leaves the heading, per lateral acceleration.
    gain_mps2: the most by which the motor accelerates.
    """

    speed_mps: float
    wheel_rad: float
    latency_s: float
    rate_radps: float
    wheelbase_m: float
    most_rad: float
    grip_mps2: float
    slip_rad_per_mps2: float
    gain_mps2: float


@value(eq=False)
class PromisedWay:
    """Poses every STEP_M, in base_link. path: of the axle. course: direction of motion, (n,). speed_mps: (n,).

    promised_m: way that the promise reaches; beyond it the last curvature goes on.
    """

    path: AxlePath
    course: Places
    speed_mps: Floats
    promised_m: float


def points_of(promise: Promise) -> tuple[Places, Floats] | Unbelievable:
    """Return places (n,) and speeds (n,) of a promise, n >= 2."""
    try:
        path_m, speed_mps = np.asarray(promise.path_m, np.float64), np.asarray(promise.speed_mps, np.float64)
        margin_m = float(promise.margin_m)
    except (TypeError, ValueError, OverflowError):
        return Unbelievable(NO_NUMBERS)
    shaped = path_m.ndim == 2 and path_m.shape[0] == 2 and 2 <= path_m.shape[1] <= MAX_POINTS
    if not shaped or speed_mps.shape != path_m.shape[1:] or not 0.0 <= margin_m <= MAX_MARGIN_M:
        return Unbelievable(NO_NUMBERS)
    possible = (speed_mps >= 0.0) & (speed_mps <= MAX_MPS)  # NaN is not
    if not (np.isfinite(path_m).all() and possible.all()):
        return Unbelievable(NO_NUMBERS)
    return path_m[0] + 1j * path_m[1], speed_mps


def way_of(places_m: Places, speed_mps: Floats, car: Roadworthy, look_m: float) -> PromisedWay | Unbelievable:
    """Return the way of a promised path from the car on, at least look_m long; or why the car cannot drive it."""
    driven = drive_promise(places_m, speed_mps, car, look_m)
    if isinstance(driven, int):
        return Unbelievable(REFUSALS[driven])
    travel_m, place_m, heading, curvature, course, speeds_mps, promised_m = driven
    return PromisedWay(AxlePath(travel_m, place_m, heading, curvature), course, speeds_mps, promised_m)


def _flat_promise(places_m: Places, speed_mps: Floats, car: Roadworthy, look_m: float) -> tuple[Any, ...]:
    return places_m, speed_mps, look_m, *car


Driven = tuple[Floats, Places, Places, Floats, Places, Floats, float]


@accelerated(flat=_flat_promise)
def drive_promise(places_m: Places, speed_mps: Floats, car: Roadworthy, look_m: float) -> Driven | int:
    """Return travel, place, heading, curvature, course, speed and promised_m of `way_of`; or the number of a refusal.

    places_m, speed_mps: (n,), n >= 2, finite.
    """
    way = _resampled(places_m, speed_mps, car, look_m)
    if isinstance(way, Unbelievable):
        return REFUSALS.index(way.reason)
    path = way.path
    return (
        path.travel_m, path.place_m, path.heading, path.curvature_per_m, way.course, way.speed_mps, way.promised_m,
    )  # fmt: skip


def _resampled(places_m: Places, speed_mps: Floats, car: Roadworthy, look_m: float) -> PromisedWay | Unbelievable:
    cut = _from_here(places_m, speed_mps)
    if isinstance(cut, Unbelievable):
        return cut
    along_m, places_m, speed_mps = cut
    chords = places_m[1:] - places_m[:-1]
    middle_m, angle_rad = (along_m[1:] + along_m[:-1]) / 2, np.empty(chords.size)
    angle_rad[0] = cmath.phase(chords[0])
    if abs(angle_rad[0]) > HERE_RAD:
        return Unbelievable(NOT_HERE)
    bend_per_m, vertex_m = np.zeros(1), middle_m
    if chords.size > 1:
        turns = chords[1:] * chords[:-1].conj()
        turned_rad = np.arctan2(turns.imag, turns.real)
        angle_rad[1:] = angle_rad[0] + turned_rad.cumsum()
        bend_per_m, vertex_m = turned_rad / (middle_m[1:] - middle_m[:-1]), along_m[1:-1]
    promised_m = float(along_m[-1])
    travel_m = STEP_M * np.arange(1, max(2, math.ceil(max(look_m, promised_m) / STEP_M) + 1), dtype=np.float64)
    within = int(travel_m.searchsorted(promised_m, side="right"))
    course_rad = np.interp(travel_m, middle_m, angle_rad)
    curvature = np.interp(travel_m, vertex_m, bend_per_m)
    beyond = int(travel_m.searchsorted(middle_m[-1]))  # from here on the last curvature turns the course
    course_rad[beyond:] += curvature[beyond:] * (travel_m[beyond:] - middle_m[-1])
    place_m = np.empty(travel_m.size, np.complex128)
    place_m[:within] = np.interp(travel_m[:within], along_m, places_m)
    steps = STEP_M * np.exp(1j * (course_rad[within:] - curvature[within:] * STEP_M / 2))
    begins_m = places_m[-1] + (within * STEP_M - promised_m) * cmath.exp(1j * angle_rad[-1])
    place_m[within:] = begins_m + steps.cumsum()
    speeds_mps = _believed_mps(np.interp(travel_m, along_m, speed_mps), travel_m, car)
    course = np.exp(1j * course_rad)
    return _driven(
        PromisedWay(AxlePath(travel_m, place_m, course, curvature), course, speeds_mps, promised_m), car, within
    )


def _from_here(places_m: Places, speed_mps: Floats) -> tuple[Floats, Places, Floats] | Unbelievable:
    """Return ways along, places and speeds from the point of the path that is nearest to the car."""
    chords = places_m[1:] - places_m[:-1]
    gaps_m = np.abs(chords)
    if not gaps_m.all() or gaps_m.max() > MAX_GAP_M:
        return Unbelievable(GAPS)
    along_m = np.zeros(places_m.size)
    gaps_m.cumsum(out=along_m[1:])
    near = max(1, int(along_m[1:].searchsorted(AHEAD_M)))
    share = -(places_m[:-1] * chords.conj()).real[:near] / gaps_m[:near] ** 2
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    off_m = np.abs(places_m[:-1][:near] + share * chords[:near])
    first = int(off_m.argmin())
    if off_m[first] > HERE_M:
        return Unbelievable(NOT_HERE)
    here_m = float(along_m[first] + share[first] * gaps_m[first])
    left_m = float(along_m[-1]) - here_m
    if left_m < MIN_SPACING_M:
        return Unbelievable(TOO_SHORT)
    chords_left = max(1.0, gaps_m.size - first - float(share[first]))
    count = max(2, math.ceil(min(left_m / MIN_SPACING_M, chords_left) - ROUNDING) + 1)
    at_m = here_m + left_m * np.arange(count) / (count - 1)
    return at_m - here_m, np.interp(at_m, along_m, places_m), np.interp(at_m, along_m, speed_mps)


def _believed_mps(promised_mps: Floats, travel_m: Floats, car: Roadworthy) -> Floats:
    """Return the speeds at ways ahead (n,): as promised, as far as the motor makes it slower or faster there."""
    brakes_m = np.maximum(travel_m - car.speed_mps * car.latency_s, 0.0)
    brake_mps2 = min(MOTOR_BRAKE_MPS2, 0.8 * car.grip_mps2)
    left = np.maximum(car.speed_mps * car.speed_mps - 2.0 * brake_mps2 * brakes_m, 0.0)
    gained_mps = np.sqrt(car.speed_mps * car.speed_mps + 2.0 * car.gain_mps2 * travel_m) + FASTER_MPS
    speeds: Floats = np.maximum(np.minimum(promised_mps, gained_mps), np.sqrt(left))
    return speeds


def _driven(way: PromisedWay, car: Roadworthy, within: int) -> PromisedWay | Unbelievable:
    """Return the way with the nose turned inward by the slip, where wheels and tyres can drive its promised part."""
    curvature, speeds_mps = way.path.curvature_per_m, way.speed_mps
    aside_mps2 = speeds_mps * speeds_mps * curvature
    if (np.abs(aside_mps2[:within]) > GRIP_SPARE * car.grip_mps2).any():
        return Unbelievable(NO_GRIP)
    wheel_rad = np.concatenate([[car.wheel_rad], np.arctan(car.wheelbase_m * curvature[:within])])
    turned_rad = car.rate_radps * STEP_M / np.maximum(speeds_mps[:within], MIN_SLEW_SPEED_MPS)
    turned_rad = np.concatenate([[0.0], turned_rad.cumsum()])
    begins_rad = np.zeros(wheel_rad.size)
    begins_rad[0] = CORRECTS_RAD - WHEEL_SPARE_RAD
    most_rad = np.minimum.accumulate(wheel_rad + begins_rad - turned_rad) + turned_rad  # from any place before
    least_rad = np.maximum.accumulate(wheel_rad - begins_rad + turned_rad) - turned_rad
    beyond = np.abs(wheel_rad).max() > car.most_rad + WHEEL_SPARE_RAD
    if beyond or (wheel_rad > most_rad + WHEEL_SPARE_RAD).any() or (wheel_rad < least_rad - WHEEL_SPARE_RAD).any():
        return Unbelievable(CANNOT_STEER)
    slip_rad = np.minimum(np.maximum(aside_mps2, -car.grip_mps2), car.grip_mps2) * car.slip_rad_per_mps2
    path = AxlePath(way.path.travel_m, way.path.place_m, way.course * np.exp(1j * slip_rad), curvature)
    return PromisedWay(path, way.course, speeds_mps, way.promised_m)
