"""Displacement of the lidar between two scans, without an assumption about its way.

Each scan is divided into patches, pieces of a wall PATCH_M to either side of a beam, with the line that fits their
points best. The patches of the later scan are laid on the lines of the earlier one (point-to-line ICP with projective
association: Chen & Medioni 1991, Blais & Levine 1995), beginning at no shift. The wheels contribute the turn only,
because a lidar that is mounted at a wrong angle shows every turn right, and every way in another direction. The answer
contains what the walls tell: parallel walls tell nothing about the way along them.
"""

import cmath
import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Correction, Scan
from wallride.runtime.control.perception.geometry import Booleans, Floats, Places, beam_ages_s, bearings_rad

PATCHES = 180
"""Approximate number of patches of a scan, of any lidar."""
PATCH_M = 0.15
MIN_BEAMS, MAX_BEAMS = 3, 24
"""Minimum and maximum number of beams to each side in a patch."""
MIN_RANGE_M, MAX_RANGE_M = 0.25, 25.0
SEEN_SHARE = 0.8
"""Minimum share of a patch's beams that have a distance."""
FLAT_M, LONG_M, LINE_RAD = 0.03, 0.17, 0.06
"""Maximum standard deviations of a patch's points across and along its line, and of the line's direction. Longer ones
are grazed walls, whose lines belong to the bearing and not to the wall."""
LONG_STEPS = 3.0
"""The same limit in distances between beams, of walls that are far for the lidar: those of MIN_BEAMS are 2 long."""
GATES_M = (0.3, 0.12, 0.06)
"""Maximum distance of a patch from its line, for each iteration."""
ALONG_M = 0.4
ENOUGH_PATCHES = 15
NOISE_M = 0.012
TURN_RAD = 0.05
"""Standard deviations of a patch's distance from its line, and of the turn by the wheels."""
UNCERTAIN_SHARE = 0.04
"""Share of the information that lines which are wrong by 0.2 rad contribute; what is not more is none."""


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """Pieces of walls in one scan, all (k,), lidar frame; valid where `flat`.

    middle_m: of their points. normals: of their lines. weight: of each, less where they overlap.
    kind: first bearing, its step from patch to patch, number of beams.
    """

    middle_m: Places
    normals: Places
    weight: Floats
    flat: Booleans
    kind: tuple[float, float, int]


@dataclass(frozen=True, slots=True, eq=False)
class Displacement:
    """Shift [m] and turn [rad] of the lidar, in its earlier frame. information: (2, 2) of the shift [1/m^2]."""

    shift_m: complex
    turn_rad: float
    information: Floats


def patches_of(scan: Scan) -> Patches:
    """Return the patches of a scan; about 0.1 ms."""
    beams, step_rad = scan.ranges_m.shape[0], scan.angle_step_rad
    every = max(1, beams // PATCHES)
    at = np.arange(0, beams, every)
    with np.errstate(invalid="ignore"):
        seen = (scan.ranges_m > MIN_RANGE_M) & (scan.ranges_m < MAX_RANGE_M)  # NaN is neither
    range_m = np.where(seen, scan.ranges_m, 0.0)
    places = range_m * _beams(scan.angle_min_rad, step_rad, beams)
    apart_m = np.maximum(range_m[at] * abs(step_rad), 1e-9)
    wide = PATCH_M / apart_m
    half = np.clip(np.rint(wide), MIN_BEAMS, MAX_BEAMS).astype(np.intp)
    first, last = np.maximum(at - half, 0), np.minimum(at + half + 1, beams)
    sums = np.zeros((4, beams + 1), np.complex128)
    np.cumsum([seen, places, places * places, range_m * range_m], axis=1, out=sums[:, 1:])
    count, place, square, size = sums[:, last] - sums[:, first]
    count = np.maximum(count.real, 1.0)
    middle_m = place / count
    # Of a complex spread, the angle is twice the line's; its size is the spread along less the spread across.
    spread = square / count - middle_m * middle_m
    along_less_across, both = np.abs(spread), size.real / count - np.abs(middle_m) ** 2
    across, along = np.maximum(both - along_less_across, 2e-6) / 2, (both + along_less_across) / 2
    flat = seen[at] & (count >= SEEN_SHARE * (2 * half + 1)) & (across < FLAT_M**2)
    flat &= along < np.maximum(LONG_M, LONG_STEPS * apart_m) ** 2
    flat &= across < LINE_RAD**2 * count * along
    normals = 1j * np.sqrt(spread / np.maximum(along_less_across, 1e-12))
    kind = scan.angle_min_rad, every * step_rad, beams
    return Patches(middle_m, normals, np.minimum(1.0, every / (2 * half + 1)), flat, kind)


@lru_cache(maxsize=4)
def _beams(angle_min_rad: float, angle_step_rad: float, beams: int) -> Places:
    turned: Places = np.exp(1j * bearings_rad(angle_min_rad, angle_step_rad, beams))
    turned.setflags(write=False)
    return turned


def corrected_anew(patches: Patches, done: Correction, wanted: Correction) -> Patches:
    """Return the patches as they were if their driver had taken out another motion. ray_s: that of `done`."""
    beams = patches.kind[2]
    beam = np.arange(0.0, beams, max(1, beams // PATCHES))
    middle_m, turned = places_anew(patches.middle_m, beam, beams, done, wanted)
    return replace(patches, middle_m=middle_m, normals=patches.normals * turned)


def places_anew(
    places_m: Places, beam: Floats, beams: int, done: Correction, wanted: Correction
) -> tuple[Places, Places]:
    """Return places (k,) as they were if their driver had taken out another motion, and by what it turned each.

    beam: place of each in a scan of so many beams.
    """
    age_s = beam_ages_s(done.ray_s, beams, beam)
    turned: Places = np.exp(1j * (done.yaw_rate_radps - wanted.yaw_rate_radps) * age_s)
    return (places_m + _moved_m(done, age_s)) * turned - _moved_m(wanted, age_s), turned


def _moved_m(motion: Correction, age_s: Floats) -> Places:
    """Return the way since, in the frame of now."""
    moved_m: Places = complex(motion.x_mps, motion.y_mps) * age_s * np.exp(-0.5j * motion.yaw_rate_radps * age_s)
    return moved_m


def displacement(before: Patches, after: Patches, turn_rad: float) -> Displacement | None:
    """Return how the lidar moved; None where too few patches fit or the scans are not of one kind.

    turn_rad: by the wheels. 0.2 to 0.3 ms.
    """
    flat = after.flat.nonzero()[0]
    if before.kind != after.kind or flat.size < ENOUGH_PATCHES:
        return None
    points, weights = after.middle_m[flat], after.weight[flat] / NOISE_M**2
    shift_m, turned_rad = 0j, turn_rad
    information = np.zeros((3, 3))
    for gate_m in GATES_M:
        pairs = _pair(before, points, weights, (shift_m, turned_rad, gate_m))
        if pairs is None:
            return None
        slopes, apart_m, weight = pairs
        weighted = slopes * weight
        information = weighted @ slopes.T
        information[2, 2] += TURN_RAD**-2
        off = weighted @ apart_m
        off[2] += (turned_rad - turn_rad) * TURN_RAD**-2
        step = np.linalg.solve(information + np.diag((1.0, 1.0, 0.0)), off)  # what is not seen stays
        shift_m, turned_rad = shift_m - complex(step[0], step[1]), turned_rad - float(step[2])
    of_turn = information[:2, 2]
    return Displacement(
        shift_m, turned_rad, _certain(information[:2, :2] - np.outer(of_turn, of_turn) / information[2, 2])
    )


def _pair(
    before: Patches, points: Places, weights: Floats, guess: tuple[complex, float, float]
) -> tuple[Floats, Floats, Floats] | None:
    """Return slopes (3, n), distances from the lines (n,) and weights (n,) of the patches that fit; None: too few."""
    shift_m, turn_rad, gate_m = guess
    turned = points * cmath.rect(1.0, turn_rad)
    there = turned + shift_m
    first_rad, step_rad, _ = before.kind
    index = np.rint(np.mod(np.angle(there) - first_rad, math.tau) / step_rad).astype(np.intp)
    index[index >= before.flat.size] = 0
    normal = before.normals[index]
    apart = (there - before.middle_m[index]) * normal.conj()
    near = before.flat[index] & (np.abs(apart.real) < gate_m) & (np.abs(apart.imag) < ALONG_M)
    if np.count_nonzero(near) < ENOUGH_PATCHES:
        return None
    normal = normal[near]
    slopes: npt.NDArray[np.float64] = np.stack((normal.real, normal.imag, (1j * turned[near] * normal.conj()).real))
    return slopes, apart.real[near], weights[near]


def _certain(information: Floats) -> Floats:
    """Return the information less that which lines of uncertain direction contribute in each direction."""
    values, axes = np.linalg.eigh(information)
    certain: Floats = (axes * np.maximum(values - UNCERTAIN_SHARE * values.sum(), 0.0)) @ axes.T
    return certain
