"""Borders of the unknown regions: points, in base_link, that the swept outline must not reach, or only at a crawl.

A wall across the path would be visible beside an unproven sector, as far as that sector's neighbours see; nothing is
visible in a blind one. A person may stand in an unproven gap, and may step into a doubted one, which has just become
silent. Widths and the crawl: `docs/laws.md`, Visibility.
"""

import math

import numpy as np

from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import ENOUGH_POINTS, NOWHERE, Booleans, Bytes, Places
from wallride.runtime.control.perception.visibility.lidar_sectors import (
    AHEAD_RAD,
    MISSING,
    SEEN,
    UNPROVEN,
    Sectors,
    next_seen,
    runs,
)

HIDES_M, HIDES_SIDE_M, HIDES_PERSON_M = 0.1, 0.2, 0.3
"""Widths of what a gap may hide: a leg in a blind one; half a person in a doubted one; a person in another unproven
one."""
NARROW_SECTORS = 2
"""Minimum width of an unproven gap that can hide a person within reach."""
CRAWL_MPS = 0.5
EDGE_STEP_M = 0.05
EDGE_WITHIN_M = 2.0


@value(eq=False)
class SectorView:
    """States of the sectors (n,) in one scan; seen: a place that each sees, base_link, NaN for none.

    blind: for longer than earlier echoes are remembered. doubted: unproven since many sectors became silent at once.
    """

    sectors: Sectors
    state: Bytes
    seen: Places
    blind: Booleans
    doubted: Booleans
    lidar_m: complex
    front_m: float


@value(eq=False)
class Unknown:
    """Borders of the unknown regions, (k,) in base_link. hard: never to be reached.

    soft: where an obstacle may stand; the speed allows a stop before it, or is a crawl. doubted: where a person may
    step in; a crawl as soon as it is within reach. blind: whether the lidar is known to be blind there.
    """

    hard: Places
    soft: Places
    doubted: Places
    blind: bool


def find_unknown(sight: SectorView, still_there_m: Places) -> Unknown:
    """Return the unknown regions; still_there_m, (k,), base_link: places seen before, in sectors now without echoes."""
    state, ahead = sight.state, sight.sectors.ahead()
    hard: list[Places] = [np.repeat(still_there_m, ENOUGH_POINTS)]
    soft: list[Places] = []
    doubted: list[Places] = []
    for first, last in runs(sight.blind):
        hard.append(_hidden(sight, first, last, HIDES_M))
    for first, last in runs(state > SEEN):
        for begin, end in runs((state[first : last + 1] == UNPROVEN) | (state[first : last + 1] == MISSING)):
            if first + end >= ahead.start and first + begin < ahead.stop and end - begin >= NARROW_SECTORS - 1:
                hard.append(_edge(sight, first, last))
                doubts = sight.doubted[first + begin : first + end + 1].any()
                width_m = HIDES_SIDE_M if doubts else HIDES_PERSON_M
                soft.append(_hidden(sight, first + begin, first + end, width_m))
                if doubts:  # the silence beside it may hide a person about to step in
                    doubted.append(_hidden(sight, first, last, HIDES_PERSON_M))
    return Unknown(_joined(hard), _joined(soft), _joined(doubted), bool(sight.blind[ahead].any()))


def _hidden(sight: SectorView, first: int, last: int, width_m: float) -> Places:
    """Return the arc at which an object of this width fits into a gap, (k,)."""
    sectors = sight.sectors
    half_rad = min((last - first + 1) * sectors.width_rad / 2, math.pi / 2 - 0.01)
    away_m = width_m / 2 / math.tan(half_rad)
    steps = max(3, math.ceil(2 * half_rad * away_m / EDGE_STEP_M))
    low_rad = max(sectors.bearing_rad(first) - sectors.width_rad / 2, -AHEAD_RAD)
    high_rad = min(sectors.bearing_rad(last) + sectors.width_rad / 2, AHEAD_RAD)
    if low_rad >= high_rad:
        return NOWHERE
    bearing_rad = np.linspace(low_rad, high_rad, steps)
    arc = np.empty(steps, np.complex128)
    arc.real = sight.lidar_m.real + away_m * np.cos(bearing_rad)
    arc.imag = sight.lidar_m.imag + away_m * np.sin(bearing_rad)
    return arc


def _edge(sight: SectorView, first: int, last: int) -> Places:
    """Return the line between the places seen on both sides of a silent run, (k,).

    With a place on one side only it is the line across the path as far ahead as that place; without any it is the
    bumper.
    """
    sides = [next_seen(sight.seen, first, -1), next_seen(sight.seen, last, 1)]
    seen = [complex(sight.seen[side]) for side in sides if side is not None]
    ahead_m = seen[0].real if seen else sight.front_m
    right = seen[0] if sides[0] is not None else complex(ahead_m, -EDGE_WITHIN_M)
    left = seen[-1] if sides[1] is not None else complex(ahead_m, EDGE_WITHIN_M)
    line = np.empty(max(3, math.ceil(abs(left - right) / EDGE_STEP_M)), np.complex128)
    line[:] = right + (left - right) * np.linspace(0.0, 1.0, line.size)
    return line


def _joined(places: list[Places]) -> Places:
    return np.concatenate(places) if places else NOWHERE
