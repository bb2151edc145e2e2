"""Tools for the assessment of the rear beams: places transformed by odometry, and the wall in front of the shoulder.

Places are complex numbers x + iy [m]; in the lidar frame an angle of one is a bearing.
"""

import math

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.drivers.api import Scan
from wallride.runtime.control.perception.geometry import Booleans, Floats, Places, places_m

Beams = npt.NDArray[np.intp]

PLACES_NEARER_THAN_M = 1.1
"""Maximum range of stored places: farther ones are seen nearer before they pass behind the shoulder."""
SAME_PLACE_M = 0.07
SAME_PLACE_BEAMS = 4
"""Association gate in beams of a place with its return: covers noise, odometry, and the motion during the scan."""
EXPECTED_BEAMS = 3
LINE_JUMP_M = 0.12
LINE_FEWEST = 12
MIN_LINE_M = 0.12
LINE_STRAIGHT_M = 0.03
LINE_WITHIN_M = 0.06


def polar(places: Places, at_m: complex, turned: complex, to_x_m: float, scan: Scan) -> tuple[Floats, Floats]:
    """Return the ranges of places, (m,), and the beams of a scan at their bearings, whole or between two.

    at_m, turned: of the lidar, in the frame of the places. to_x_m: places farther ahead of it are left out, and those
    beyond PLACES_NEARER_THAN_M.
    """
    here = (places - at_m) * turned.conjugate()
    away_m = np.abs(here)
    near = ((here.real <= to_x_m) & (away_m < PLACES_NEARER_THAN_M)).nonzero()[0]  # quicker than the mask
    here = here[near]
    return away_m[near], (np.arctan2(here.imag, here.real) - scan.angle_min_rad) / scan.angle_step_rad


@accelerated
def seen_again(ranges_m: Floats, beams: Beams, away_m: Floats, at_beam: Floats) -> Booleans:
    """Return which of some beams, (k,), end at one of the places, `polar` (m,); ranges_m is (n,)."""
    if not beams.size or not at_beam.size:
        return np.zeros(beams.shape, np.bool_)
    inside = (at_beam > -1.0) & (at_beam < ranges_m.size) & (away_m < ranges_m[beams].max() + SAME_PLACE_M)
    off_m = np.abs(ranges_m[beams][:, None] - away_m[inside])
    # Cast before: numpy 2.4 crashes where it finds no memory for its own buffers of a cast.
    off_beams = np.abs(beams.astype(np.float64)[:, None] - at_beam[inside])
    again: Booleans = ((off_m < SAME_PLACE_M) & (off_beams <= SAME_PLACE_BEAMS)).any(axis=1)
    return again


@accelerated
def expected_m(beams: int, away_m: Floats, at_beam: Floats) -> Floats:
    """Return the expected range of every beam, (n,), by the nearest place, `polar` (m,), beside it; inf if none."""
    found_m = np.full(beams, np.inf)
    inside = (at_beam > -0.5) & (at_beam < beams - 0.5)
    nearest_m = np.full(beams + 2 * EXPECTED_BEAMS, np.inf)
    np.minimum.at(nearest_m, np.rint(at_beam[inside]).astype(np.intp) + EXPECTED_BEAMS, away_m[inside])
    for beside in range(2 * EXPECTED_BEAMS + 1):
        np.minimum(found_m, nearest_m[beside : beside + beams], out=found_m)
    return found_m


def on_the_line(x_m: Floats, y_m: Floats, solid: Booleans, before: Beams, beams: Beams) -> Booleans:
    """Return which of some beams, (k,), end on the straight wall that is seen before the shoulder.

    x_m, y_m, solid: of a View, (n,). before: beams from the shoulder forward; the wall is the piece that begins there.
    """
    none = np.zeros(beams.shape, np.bool_)
    if not beams.size:
        return none
    before = before[solid[before]]
    if before.size < LINE_FEWEST:
        return none
    places = places_m(x_m, y_m, before)
    jumps = np.flatnonzero(np.abs(places[1:] - places[:-1]) > LINE_JUMP_M)
    piece = places[: int(jumps[0]) + 1] if jumps.size else places
    if piece.size < LINE_FEWEST or abs(piece[-1] - piece[0]) < MIN_LINE_M:
        return none
    middle = complex(piece.mean())
    off = piece - middle
    along = np.sqrt((off * off).sum())  # of a line's points this is its direction times their spread
    size = abs(along)
    if not size:
        return none
    along /= size
    if math.sqrt(np.square((off / along).imag).sum() / off.size) > LINE_STRAIGHT_M:
        return none
    aside_m = ((places_m(x_m, y_m, beams) - middle) / along).imag
    near: Booleans = np.abs(aside_m) < LINE_WITHIN_M
    return near


def around(which: Booleans, first_side: int, reach: int) -> npt.NDArray[np.intp]:
    """Return the number of True within `reach` beams of each, (k,), the two sides of the car separately."""
    counts = np.zeros(which.shape, np.intp)
    for part in (slice(0, first_side), slice(first_side, None)):
        some = which[part]
        if some.size and np.count_nonzero(some):
            total = np.zeros(some.size + 2 * reach + 1, np.intp)  # of the beams up to each, and beyond both ends
            np.cumsum(some, out=total[reach + 1 : some.size + reach + 1])
            total[some.size + reach + 1 :] = total[some.size + reach]
            counts[part] = total[2 * reach + 1 :] - total[: some.size]
    return counts
