"""Scan matching over a few supposed motions: ahead as supposed, backward, none, farther, or another way round.

A search over a few dozen shifts instead of an iteration, because the question is which of several far answers is right,
and an iteration that begins at one of them stays there. A point of the later scan, shifted, is compared with the range
that the earlier one has at its bearing (projective association, Blais and Levine 1995). Own parts of the car would vote
for "stands": only what is before the shoulders counts. Two answers take 0.1 ms, all about 1 ms; not for the hot path.
"""

import math
from collections.abc import Sequence
from enum import Enum

import numpy as np
import numpy.typing as npt

from drivers.api import Scan
from drivers.value import value
from runtime.control.perception.geometry import Booleans, Floats, Places, points_m, sector

Shift = tuple[float, float, float]
"""Shift x_m, y_m, yaw_rad of base_link, in its earlier frame."""

TURNS_RAD = np.radians([-12.0, -9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0, 12.0])
FINE_TURNS_RAD = np.radians([-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5])
AS_SUPPOSED_RAD = np.zeros(1)
"""Added to the supposed heading: trim, slip and a servo that lags."""
BEFORE_RAD = math.radians(95)
AHEAD_RAD = math.radians(45)
MIN_RANGE_M, NEAR_M = 0.15, 10.0
FACING_M = 0.15
"""Maximum difference over five beams of a surface that is compared however far it is: grazing beams tell of noise."""
POINTS = 150
ENOUGH_POINTS = 40
CAP_M = 0.1
"""Maximum misfit of one point: beyond it a point only counts as not fitting, because people walk and edges hide."""
TELLS_M, ENOUGH_TELL = 0.05, 12
"""Minimum difference, and minimum number, of informative points: a point on a wall parallel to the motion fits at any
shift."""
AGREES_BELOW_M, MANY_OFF = 0.035, 24
"""Mean misfit below which a motion explains a scan, and number of points off their place from which it does not: an end
wall that is somewhere else has more."""
CLEARER_M, CLEARER_SHARE = 0.01, 1.2
"""Minimum difference and ratio by which every other answer must fit worse."""
STANDS_BELOW_M, CONTRADICTS_BELOW_M = 0.02, 0.035
"""Maximum misfit of a motion that contradicts the supposed one: where people walk all around, nothing fits; a scene
that stands fits to its noise."""
ENOUGH_CONTRADICT, FEW_BELOW_M = 20, 0.016
"""Number of points below which it has to fit as well as this."""
LONE_EDGE_M, LONE_WIDTH_M = 0.3, 1.5
"""Depth of the edges, and maximum width, of a thing that stands out on both sides: a person or a car may go along."""


class Agreement(Enum):
    """How the scans' shift compares with the supposed one.

    TURNED: as far, but another way. DIFFERS: one of several others.
    """

    AGREES = "agrees"
    STANDS = "stands"
    OPPOSITE = "opposite"
    FARTHER = "farther"
    TURNED = "turned"
    DIFFERS = "differs"
    UNKNOWN = "unknown"


@value(eq=False)
class Answers:
    """Supposed motions, (answers,): share of the way, its direction as a unit vector, and what it means."""

    shares: Floats
    ways: Places
    means: tuple[Agreement, ...]

    def only(self, which: Sequence[int]) -> "Answers":
        """Return some of them."""
        return Answers(self.shares[which], self.ways[which], tuple(self.means[one] for one in which))


def _answers(*parts: tuple[Agreement, tuple[float, ...], tuple[float, ...]]) -> Answers:
    all_of = [
        (share, np.exp(1j * math.radians(way_deg)), answer)
        for answer, shares, ways_deg in parts
        for share in shares
        for way_deg in ways_deg
    ]
    shares, ways, means = zip(*all_of, strict=True)
    return Answers(np.array(shares), np.array(ways), means)


FIRST = _answers((Agreement.AGREES, (1.0,), (0.0,)), (Agreement.STANDS, (0.0,), (0.0,)))
SECOND = _answers((Agreement.AGREES, (0.75, 1.0, 1.25), (0.0,)), (Agreement.STANDS, (0.0,), (0.0,)))
"""The wheels' report is up to a poll old: 0.06 m at 3 m/s."""
ALL = _answers(
    (Agreement.OPPOSITE, (-1.5, -1.25, -1.0, -0.75, -0.5), (0.0,)),
    (Agreement.STANDS, (0.0, 0.25), (0.0,)),
    (Agreement.AGREES, (0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0), (0.0,)),
    (Agreement.FARTHER, (2.5, 3.0, 3.5), (0.0,)),
    (Agreement.TURNED, (1.0,), (-135.0, -90.0, -60.0, 60.0, 90.0, 135.0)),
)


@value(eq=False)
class Fits:
    """Misfit of each point for each supposed motion, (answers, points), at its best turn.

    turn_rad: that turn, (answers,). beams: of the later scan, which the points are of, (points,).
    """

    answers: Answers
    misfit_m: Floats
    turn_rad: Floats
    after: Scan
    beams: npt.NDArray[np.intp]

    @property
    def agree(self) -> bool:
        """Return whether the supposed motion explains what is seen, whether or not another one does as well."""
        agrees_m = self.misfit_m[self.answers.means.index(Agreement.AGREES)]
        tells = self._tells
        fits = np.count_nonzero(tells) < ENOUGH_TELL or agrees_m[tells].mean() < AGREES_BELOW_M
        return bool(fits) and int(np.count_nonzero(agrees_m >= CAP_M)) < MANY_OFF

    @property
    def fit_nowhere(self) -> bool:
        """Return whether no motion explains what is seen."""
        return int(np.count_nonzero(self.misfit_m >= CAP_M, axis=1).min()) >= MANY_OFF

    @property
    def _tells(self) -> Booleans:
        tells: Booleans = self.misfit_m.max(axis=0) - self.misfit_m.min(axis=0) > TELLS_M
        return tells

    def answer(self, *, ahead: bool = False) -> Agreement:
        """Return which answer fits clearly better than all others; UNKNOWN without one, as in a bare corridor.

        ahead: by the points ahead alone. That the scene stands is not said by what may go along with the car.
        """
        tells = self._tells
        if ahead:
            scan = self.after
            tells &= np.abs(scan.angle_min_rad + scan.angle_step_rad * self.beams) < AHEAD_RAD
        found = self._best(tells)
        movable = found in {Agreement.STANDS, Agreement.DIFFERS}
        return self._best(tells & ~_stands_out(self.after)[self.beams]) if movable else found

    def _best(self, tells: Booleans) -> Agreement:
        """Return the answer that fits best, if it does so clearly by the points that tell it from each other one."""
        if np.count_nonzero(tells) < ENOUGH_TELL:
            return Agreement.UNKNOWN
        misfit_m, means = self.misfit_m[:, tells], self.answers.means
        best = int(misfit_m.mean(axis=1).argmin())
        pairs = np.abs(misfit_m - misfit_m[best]) > TELLS_M
        count = np.maximum(np.count_nonzero(pairs, axis=1), 1)
        own_m, other_m = (pairs * misfit_m[best]).sum(axis=1) / count, (pairs * misfit_m).sum(axis=1) / count
        clear = (count >= ENOUGH_TELL) & (other_m > CLEARER_SHARE * own_m + CLEARER_M)
        rivals = {answer for one, answer in enumerate(means) if one != best and not clear[one]}
        if means[best] is Agreement.AGREES:
            return Agreement.UNKNOWN if rivals else Agreement.AGREES
        agrees = means.index(Agreement.AGREES)
        within_m = STANDS_BELOW_M if means[best] is Agreement.STANDS else CONTRADICTS_BELOW_M
        few = count[agrees] < ENOUGH_CONTRADICT
        unsure = own_m[agrees] > (FEW_BELOW_M if few else within_m)
        if unsure or rivals & {Agreement.AGREES, Agreement.FARTHER}:
            return Agreement.UNKNOWN
        return Agreement.DIFFERS if rivals else means[best]


def compare_shift(before: Scan, after: Scan, moved: Shift, lidar_m: complex) -> Agreement:
    """Return which of all answers fits clearly best.

    moved: base_link's shift between the scans as supposed. Both scans of one sensor, else UNKNOWN.
    """
    found = best_fits(before, after, moved, lidar_m, ALL)
    return found.answer() if found is not None else Agreement.UNKNOWN


def best_fits(before: Scan, after: Scan, moved: Shift, lidar_m: complex, answers: Answers) -> Fits | None:
    """Return how well the scans fit by the best motion of each kind of answer, at its best turn.

    None where too few points are seen, or the scans are not of one kind.
    """
    coarse = fits(before, after, moved, lidar_m, answers, TURNS_RAD)
    if coarse is None:
        return None
    misfits_m = coarse.misfit_m.mean(axis=1).tolist()
    best: dict[Agreement, int] = {}
    for number, answer in enumerate(answers.means):
        if answer not in best or misfits_m[number] < misfits_m[best[answer]]:
            best[answer] = number
    which = list(best.values())
    # The grid of turns is coarse: a motion whose own turn lies on it must not fit better than one between two.
    fine_rad = coarse.turn_rad[which][:, None] + FINE_TURNS_RAD
    return fits(before, after, moved, lidar_m, answers.only(which), fine_rad)


def fits(before: Scan, after: Scan, moved: Shift, lidar_m: complex, answers: Answers, turns_rad: Floats) -> Fits | None:
    """Return how well the scans fit by each answer; turns_rad: added to its heading, (turns,) or (answers, turns)."""
    beams = before.ranges_m.shape[0]
    if after.ranges_m.shape[0] != beams or after.angle_min_rad != before.angle_min_rad:
        return None
    ahead = sector(after, -BEFORE_RAD, BEFORE_RAD)
    ahead = slice(ahead.start, ahead.stop, max(1, (ahead.stop - ahead.start) // POINTS))
    seen = _usable(after.ranges_m)[ahead]
    points = points_m(after, ahead)[:, seen]
    if points.shape[1] < ENOUGH_POINTS:
        return None
    turn_rad = np.broadcast_to(turns_rad, (answers.shares.size, turns_rad.shape[-1]))
    x_m, y_m, yaw_rad = _lidar_shifts(moved, lidar_m, answers, turn_rad)
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    shifted_x_m = cos * points[0] - sin * points[1] + x_m[:, None]
    shifted_y_m = sin * points[0] + cos * points[1] + y_m[:, None]
    place = (np.arctan2(shifted_y_m, shifted_x_m) - before.angle_min_rad) / before.angle_step_rad
    index = np.floor(place).astype(np.intp)
    known = (index >= 0) & (index < beams - 1)
    index[~known] = 0
    # Between two beams a wall's 1 / range is straight; the nearest beam's range instead would favour no shift at all.
    nearness = 1.0 / before.ranges_m.astype(np.float64)
    first, share = nearness[index], place - index
    there_m = 1.0 / (first + share * (nearness[index + 1] - first))
    off_m = np.abs(np.hypot(shifted_x_m, shifted_y_m) - there_m)
    off_m = np.where(known & (off_m < CAP_M), off_m, CAP_M)  # NaN is not smaller
    by_turn_m = off_m.reshape(*turn_rad.shape, -1)
    turn = by_turn_m.mean(axis=2).argmin(axis=1)
    each, beam = np.arange(answers.shares.size), np.arange(ahead.start, ahead.stop, ahead.step)[seen]
    return Fits(answers, by_turn_m[each, turn], turn_rad[each, turn], after, beam)


def _usable(ranges_m: npt.NDArray[np.float32]) -> Booleans:
    """Return which beams (n,) are compared: near ones, and far ones of a surface that faces the lidar."""
    facing = np.zeros(ranges_m.size, np.bool_)
    facing[2:-2] = np.abs(ranges_m[4:] - ranges_m[:-4]) < FACING_M
    usable: Booleans = (ranges_m > MIN_RANGE_M) & ((ranges_m < NEAR_M) | facing)  # NaN is neither
    return usable


def _stands_out(scan: Scan) -> Booleans:
    """Return which beams (n,) see something narrow that is nearer than what is on both sides of it."""
    ranges_m = scan.ranges_m.astype(np.float64)
    ranges_m[np.isnan(ranges_m)] = math.inf
    with np.errstate(invalid="ignore"):
        step_m = np.diff(ranges_m)
    edges = np.flatnonzero(~(np.abs(step_m) <= LONE_EDGE_M + 0.05 * ranges_m[:-1]))
    lone = np.zeros(ranges_m.size, np.bool_)
    for left, right in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        width_m = (right - left) * abs(scan.angle_step_rad) * ranges_m[left + 1]
        lone[left + 1 : right + 1] = step_m[left] < 0 < step_m[right] and width_m < LONE_WIDTH_M
    return lone


def _lidar_shifts(moved: Shift, lidar_m: complex, answers: Answers, turn_rad: Floats) -> tuple[Floats, Floats, Floats]:
    """Return x_m, y_m and yaw_rad of the lidar for every answer and turn, (answers x turns,).

    The share s of an arc: along it s times, aside s^2 times, turned s times.
    """
    share = answers.shares[:, None]
    way = (share * moved[0] + 1j * share * share * moved[1]) * answers.ways[:, None]
    yaw_rad = (share * moved[2] + turn_rad).ravel()
    at = np.repeat(way.ravel(), turn_rad.shape[1]) + lidar_m * (np.exp(1j * yaw_rad) - 1.0)
    return at.real, at.imag, yaw_rad
