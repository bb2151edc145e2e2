"""Tools for the assessment of the lidar window: dirt candidates, the evidence per beam, runs of beams."""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.perception.geometry import Booleans, Floats
from wallride.runtime.control.perception.view import DIRT_STANDS_OUT_M, View

NEIGHBOUR_BEAMS = (40, 60)
"""Distances in beams to the left and right, 10 and 15 degrees, at which dirt is compared with its surroundings."""
_NOTHING_M = np.full(max(NEIGHBOUR_BEAMS), math.inf)
"""Ranges assumed beyond the ends of the fan."""
_NEIGHBOURS = _NOTHING_M.size + np.array([[sign * apart] for apart in NEIGHBOUR_BEAMS for sign in (-1, 1)])
SMUDGE_NEARER_THAN_M = 0.9
"""Maximum range of dirt: the rim of a real smudge reads up to 0.8 m, a mixture of the dirt and the wall behind it."""
ON_THE_WINDOW_M = 0.06
STEADY_WITHIN_M = 0.06
"""Maximum change of a steady range: three standard deviations of a noisy lidar (0.02 m)."""
BODY_NEARER_THAN_M = 0.45
"""Maximum range of the car's own body: no stationary object beside the car's tail keeps its distance to the centimetre
over that way."""
BLIND_ABOVE = 0.95
BESIDE_ECHOES_BEAMS = 80
BESIDE_ECHOES_SHARE = 0.25
"""Minimum share of beams with an echo within 20 degrees for a missing echo to be evidence: open space returns none."""
GROUP_BEAMS = 8
"""Maximum gap in beams within one reported patch."""


class Evidence(NamedTuple):
    """Evidence of every beam, (n,) each.

    near_m: where the beam's dirt is, NaN where none was seen. dirt, body, blind: in 0..1 for dirt, for the car's body,
    for a beam that sees nothing.
    """

    near_m: Floats
    dirt: Floats
    body: Floats
    blind: Floats


class LearningShares(NamedTuple):
    """Shares of what is new; quickly is for parts of the car, turned for blindness."""

    learns: float
    quickly: float
    turned: float


def _flat_dirt(view: View, rear: Booleans, before: Evidence, shares: LearningShares) -> tuple[Any, ...]:
    return (
        view.ranges_m, view.no_echo, view.own, rear, before.near_m, before.dirt, before.body, before.blind,
        shares.learns, shares.quickly, shares.turned,
    )  # fmt: skip


@accelerated(flat=_flat_dirt)
def weigh_dirt(
    view: View, rear: Booleans, before: Evidence, shares: LearningShares
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the fields of Evidence after one more scan; no array is changed.

    rear: beams behind BODY_BEYOND_RAD, (n,).
    """
    ranges_m, no_echo, own = view.ranges_m, view.no_echo, view.own
    near_m, dirt, body, blind = before
    learns, quickly, turned = shares
    near = stands_out(ranges_m)
    seen_m, kept_m = ranges_m.take(near), near_m.take(near)
    off_m = seen_m - kept_m
    near_m = near_m.copy()
    near_m[near] = np.where(np.isnan(kept_m), seen_m, kept_m + learns * off_m)
    of_body = own & rear
    steady = near[~(np.abs(off_m) >= STEADY_WITHIN_M) & ~of_body.take(near)]  # NaN: seen near for the first time
    # p + learns (seen - p), seen being 1 or 0
    body = body * (1 - learns)
    body[of_body] += learns
    # Near returns behind the shoulders are learnt quickly, and silence is no evidence: black parts seldom echo.
    part = rear & (near_m < BODY_NEARER_THAN_M)
    learnt = dirt * (1 - learns)
    np.copyto(learnt, dirt, where=part & no_echo)
    known = dirt.take(steady)
    learnt[steady] = known + np.where(part.take(steady), quickly, learns) * (1 - known)
    if turned:
        # Only turning tells a blind beam from a long corridor: the emptiness turns with the car.
        blind = np.where(beside_echoes(no_echo), blind + turned * (no_echo - blind), blind)
    return near_m, learnt, body, blind


def _flat_find(
    evidence: Evidence,
    doubted: Booleans | None,
    before: tuple[Booleans, Booleans, Booleans],
    mask_above: float,
    unmask_below: float,
) -> tuple[Any, ...]:
    return evidence.dirt, evidence.body, evidence.blind, doubted, before, mask_above, unmask_below


@accelerated(flat=_flat_find)
def find_dirt(
    evidence: Evidence,
    doubted: Booleans | None,
    before: tuple[Booleans, Booleans, Booleans],
    mask_above: float,
    unmask_below: float,
) -> tuple[tuple[Booleans, Booleans, Booleans] | None, bool]:
    """Return which beams are dirty, which the car's own and which blinded, and whether one is dirty or blinded.

    doubted: where alone dirt is believed in; None: everywhere. before: what was
    returned last; where nothing has changed, None is returned in its place.
    """
    _, dirt, body, blind = evidence
    doubtful = dirt >= unmask_below
    if doubted is not None:
        doubtful &= doubted
    surely = ((dirt > mask_above) | before[0]) & doubtful
    now = runs_with(doubtful, surely), body > mask_above, blind > BLIND_ABOVE
    changed = any(np.count_nonzero(a != b) for a, b in zip(now, before, strict=True))
    return now if changed else None, bool(np.count_nonzero(now[0] | now[2]))


def stands_out(ranges_m: Floats) -> npt.NDArray[np.intp]:
    """Return the indices of beams within the range of a smudge and 0.12 m nearer than both beams NEIGHBOUR_BEAMS away.

    At the ends of the fan only one of the two exists. No echo counts as far. On the glass itself all beams do.
    """
    near: npt.NDArray[np.intp] = (ranges_m < SMUDGE_NEARER_THAN_M).nonzero()[0]  # NaN compares as not nearer
    if not near.size:
        return near
    near_m = ranges_m.take(near)
    around_m = np.concatenate((_NOTHING_M, ranges_m, _NOTHING_M)).take(near + _NEIGHBOURS)
    hidden = around_m - near_m < DIRT_STANDS_OUT_M  # NaN, no echo, hides nothing
    hidden = (hidden[0] | hidden[1]) & (hidden[2] | hidden[3])
    standing_out: npt.NDArray[np.intp] = near[~hidden | (near_m < ON_THE_WINDOW_M)]
    return standing_out


def beside_echoes(no_echo: Booleans) -> Booleans:
    """Return the beams (n,) within 20 degrees of which at least a quarter of all beams have an echo."""
    most = BESIDE_ECHOES_BEAMS
    # Cumulative number of echoes up to each beam, padded with beams without one before the first and after the last.
    echoes = np.zeros(no_echo.size + 2 * most + 1, np.intp)
    np.cumsum(~no_echo, out=echoes[most + 1 : -most])
    echoes[-most:] = echoes[-most - 1]
    near: Booleans = echoes[2 * most + 1 :] - echoes[: -2 * most - 1] >= _enough_echoes(no_echo.size)
    return near


@lru_cache(maxsize=8)
def _enough_echoes(beams: int) -> Floats:
    """Return the sufficient number of echoes around each beam; at the ends of the fan there are fewer beams."""
    index = np.arange(beams)
    first = np.maximum(index - BESIDE_ECHOES_BEAMS, 0)
    end = np.minimum(index + BESIDE_ECHOES_BEAMS + 1, beams)
    enough: Floats = BESIDE_ECHOES_SHARE * (end - first)
    return enough


def runs(which: Booleans) -> list[tuple[int, int]]:
    """Return (first, one past the last) of every run of True."""
    if not np.count_nonzero(which):
        return []  # as in most scans
    edges: list[int] = ((which[1:] != which[:-1]).nonzero()[0] + 1).tolist()
    if which[0]:
        edges.insert(0, 0)
    if which[-1]:
        edges.append(which.size)
    return list(zip(edges[::2], edges[1::2], strict=True))


def runs_longer_than(which: Booleans, most: int) -> Booleans:
    """Return only the runs of True that are longer than this."""
    longer = np.zeros(which.shape, np.bool_)
    for first, end in runs(which):
        longer[first:end] = end - first > most
    return longer


def runs_with(which: Booleans, some: Booleans) -> Booleans:
    """Return only the runs of True that contain one of `some`, a subset of `which`: certain dirt with its rim."""
    kept = np.zeros(which.shape, np.bool_)
    if not np.count_nonzero(some):
        return kept
    for first, end in runs(which):
        kept[first:end] = some[first:end].any()
    return kept


def patches(which: Booleans, bearing_rad: Floats) -> list[tuple[int, float]]:
    """Return (beams, middle bearing in degrees) of each patch of beams; small gaps do not divide a patch."""
    index = np.flatnonzero(which)
    return [(int(group.size), math.degrees(float(bearing_rad[index[group]].mean()))) for group in groups(index)]


def groups(beam: npt.NDArray[np.intp]) -> list[npt.NDArray[np.intp]]:
    """Return the places in a list of beams, (n,), ascending, of those of each patch."""
    places = np.arange(beam.size)
    return np.split(places, np.flatnonzero(np.diff(beam) > GROUP_BEAMS) + 1) if beam.size else []
