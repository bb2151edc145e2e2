"""Start places in real buildings, chosen on a map by a rule.

A ball of the wanted distance is rolled along all walls (`wallride.sim.ball_contour`). A place is good where its way can
be driven for WAY_M, begins straight, and bends by at least CORNER_RAD within sight: corners, offsets, ends of walls. Of
all good places of a map PLACES are taken, evenly spread along the walls, and WALLS more without a corner. Each has one
of the STARTS, in turn; a start that has no room (the building is narrow there) is replaced by the next one.

Every second place of a map is held out: no law was tuned on it. So are all places of the maps HELD_OUT.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from wallride.sim.world.ball_contour import Places, places
from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.map_file import read_geometry
from wallride.sim.world.place import World
from wallride.sim.world.pose import Booleans, Floats, Pose, Side, side_sign

PLACES, WALLS = 10, 2
HELD_OUT = ("hangar", "levine")
WAY_M = 14.0
STRAIGHT_M, STRAIGHT_RAD = 1.5, math.radians(20)
CORNER_WITHIN_M, CORNER_RAD = 6.0, math.radians(45)
ROOM_M, AHEAD_M = 0.12, 0.6
"""Minimum free room around the car at a start, and ahead of it."""
OFF_M = 0.15
"""Maximum deviation of the distance to the wall beside a start."""
STARTS = {
    "on": (1.0, 0.0),
    "close": (0.5, 0.0),
    "far": (1.5, 0.0),
    "toward": (1.0, math.radians(20)),
    "away": (1.0, -math.radians(20)),
}
"""Share of the wanted distance, and the angle towards the wall."""
_SAMPLE_M = 0.25


@dataclass(frozen=True, slots=True)
class BuildingStart:
    """Start of a run. number: along the walls of its map."""

    number: int
    start: str
    pose: Pose
    corner: bool


def is_held_out(map_name: str, number: int) -> bool:
    """Return whether a place is held out of all tuning."""
    return map_name in HELD_OUT or number % 2 == 1


@lru_cache(maxsize=32)
def building(path: str, side: Side) -> World:
    """Return a map as a world with a start of no meaning."""
    return World(Path(path).stem, _geometry(path), Pose(0.0, 0.0, 0.0), side)


@lru_cache(maxsize=8)
def _geometry(path: str) -> GridGeometry:
    return read_geometry(Path(path))[0]


@lru_cache(maxsize=64)
def places_on(path: str, side: Side, desired_m: float) -> tuple[BuildingStart, ...]:
    """Return the places of a map for a side and a wanted distance; none where that distance fits nowhere."""
    from scipy import ndimage

    world, geometry = building(path, side), _geometry(path)
    away_m = np.round(ndimage.distance_transform_edt(~geometry.solid) * geometry.cell_m, 6)
    if away_m.max() < desired_m:
        return ()
    rolled = places(away_m, geometry.cell_m, desired_m, side)
    good, corner = _good(rolled, geometry.cell_m)
    found: list[BuildingStart] = []
    for which, count in ((corner, PLACES), (~corner, WALLS)):
        index = np.flatnonzero(good & which)
        if not index.size:
            continue
        for at in index[np.unique(np.linspace(0, index.size - 1, count).astype(np.int64))]:
            place = _started(world, rolled, int(at), desired_m, len(found), corner=which is corner)
            if place is not None:
                found.append(place)
    return tuple(found)


def _good(rolled: Places, cell_m: float) -> tuple[Booleans, Booleans]:
    """Return the places that begin straight and can be driven for long enough; and those with a corner within sight."""
    count = len(rolled.cell)
    steps_m = np.hypot(*(np.diff(rolled.cell, axis=0).T)) * cell_m
    ring = np.concatenate([[0], np.cumsum(steps_m > 3 * cell_m)])
    along_m = np.concatenate([[0.0], np.cumsum(np.minimum(steps_m, cell_m * math.sqrt(2)))])
    good: Booleans = rolled.way_m >= WAY_M
    corner = np.zeros(count, np.bool_)
    for reach_m in np.arange(_SAMPLE_M, CORNER_WITHIN_M + _SAMPLE_M, _SAMPLE_M):
        there = np.minimum(np.searchsorted(along_m, along_m + reach_m), count - 1)
        cos = np.sum(rolled.heading * rolled.heading[there], axis=1)
        same = ring == ring[there]
        good &= same
        if reach_m <= STRAIGHT_M:
            good &= cos > math.cos(STRAIGHT_RAD)
        corner |= same & (cos < math.cos(CORNER_RAD))
    return good, corner


def _started(
    world: World, rolled: Places, index: int, desired_m: float, number: int, *, corner: bool
) -> BuildingStart | None:
    """Return a place with the first start, from its own on, that has room; None where none has."""
    geometry = world.geometry
    assert isinstance(geometry, GridGeometry)  # noqa: S101 - maps are grids
    x_m, y_m = geometry.cell_centre(*(int(part) for part in rolled.cell[index]))
    heading: Floats = rolled.heading[index]
    along = Pose(x_m, y_m, geometry.origin.yaw_rad + math.atan2(heading[1], heading[0]))
    names = list(STARTS)
    for turn in range(len(names)):
        name = names[(number + turn) % len(names)]
        share, toward_rad = STARTS[name]
        sign = side_sign(world.side)
        at = along.ahead(0.0, sign * (1.0 - share) * desired_m)
        pose = Pose(at.x_m, at.y_m, at.yaw_rad + sign * toward_rad)
        free = all(world.clearance(pose.ahead(way_m)) > ROOM_M for way_m in (0.0, AHEAD_M))
        if free and abs(world.wall_distance_m(at) - share * desired_m) < OFF_M:
            return BuildingStart(number, name, pose, corner)
    return None
