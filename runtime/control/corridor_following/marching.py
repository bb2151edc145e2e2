"""A way in the middle between two borders, step by step: the first guess of a way, which `bending` then straightens.

Between the nearest returns of either border the middle goes at right angles to the line that joins them.
"""

import cmath
import math
from typing import Final

import numpy as np

from wallride.runtime.control.corridor_following.borders import CourseBorders, CourseReturns
from wallride.runtime.control.perception.geometry import Floats, Places

STEP_M: Final = 0.2
SHARPEST_PER_M, UNSEEN_PER_M = 1.2, 0.05
"""Sharpest bend of the march, and of its steps into what is hidden: those go straight on."""
BACK_PER_M, BACK_RAD = 1.2, 0.6
"""Heading toward the middle for each metre beside it, and the largest one."""
FAR_M: Final = 5.0
"""A border that is farther away does not count: the way keeps MOST_ASIDE_M from the other one."""
MOST_ASIDE_M: Final = 1.5
LEAST_WIDTH_M: Final = 0.6
UNSEEN_STEPS: Final = 2
"""Number of steps into what is hidden: a longer guess round the corner at its end meets the wall of an S bend."""
MOST_POINTS: Final = 60
TURNS_BACK: Final = -0.5
"""Cosine of the angle from which the middle leads back."""


def course_of(places_m: Places) -> Places:
    """Return the directions (n,) of a way at its points."""
    steps = np.diff(places_m)
    chords = np.concatenate([steps[:1], steps[1:] + steps[:-1], steps[-1:]])
    course: Places = chords / np.maximum(np.abs(chords), 1e-9)
    return course


def curvature_of(places_m: Places) -> Floats:
    """Return the curvature (n,) at a way's points, n >= 3, left positive: that of the circle through neighbours."""
    behind, ahead = places_m[1:-1] - places_m[:-2], places_m[2:] - places_m[1:-1]
    chord = behind + ahead
    bent = 2.0 * (behind.conj() * ahead).imag / np.maximum(np.abs(behind) * np.abs(ahead) * np.abs(chord), 1e-9)
    curvature: Floats = np.concatenate([bent[:1], bent, bent[-1:]])
    return curvature


def marched(way_m: Places, course: complex, borders: CourseBorders, returns: CourseReturns) -> Places:
    """Return a way (n,) continued from its end in a direction, as far as there is room, and a bit into the unseen."""
    place_m = complex(way_m[-1])
    found: list[complex] = []
    unseen = 0
    while len(found) + way_m.size < MOST_POINTS and unseen < UNSEEN_STEPS:
        ahead = _course(place_m, borders)
        if ahead is None or (ahead * course.conjugate()).real < TURNS_BACK:
            break
        turned_rad = cmath.phase(ahead * course.conjugate())
        turn_rad = (UNSEEN_PER_M if unseen else SHARPEST_PER_M) * STEP_M
        course *= cmath.exp(1j * min(max(turned_rad, -turn_rad), turn_rad))
        place_m += STEP_M * course
        found.append(place_m)
        if returns.sees(np.array([place_m]))[0] < 0.0:
            unseen += 1
    return np.concatenate([way_m, found]) if found else way_m


def _course(place_m: complex, borders: CourseBorders) -> complex | None:
    """Return the direction of the way on at a place, None where there is no room."""
    left_m, left = _nearest(place_m, borders.left_m)
    right_m, right = _nearest(place_m, borders.right_m)
    if left_m + right_m < LEAST_WIDTH_M or min(left_m, right_m) > FAR_M:
        return None
    if right_m > FAR_M:
        ahead, aside_m = -1j * (left - place_m) / left_m, MOST_ASIDE_M - left_m
    elif left_m > FAR_M:
        ahead, aside_m = 1j * (right - place_m) / right_m, right_m - MOST_ASIDE_M
    else:
        ahead = -1j * (left - right) / max(abs(left - right), 1e-6)
        aside_m = min((left_m + right_m) / 2, MOST_ASIDE_M) - left_m
    return ahead * cmath.exp(-1j * min(max(BACK_PER_M * aside_m, -BACK_RAD), BACK_RAD))


def _nearest(place_m: complex, border_m: Places) -> tuple[float, complex]:
    if not border_m.size:
        return math.inf, place_m
    away_m = np.abs(border_m - place_m)
    nearest = int(away_m.argmin())
    return max(float(away_m[nearest]), 1e-6), complex(border_m[nearest])
