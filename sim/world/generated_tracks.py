"""Closed tracks generated from a seed: four to eight lanes, each of its own width, and the corners between them.

The centre line is a polygon round a middle, driven clockwise, so that the followed wall on the left is the outer one;
`inner` is the same track driven the other way round. For the right-hand side mirror the world.
"""

import math
from itertools import combinations

import numpy as np

from wallride.sim.world.floor_plan import FloorPlan
from wallride.sim.world.generated_rooms import MAX_WIDTH_M, MIN_WIDTH_M, TRIES
from wallride.sim.world.lap import Lap
from wallride.sim.world.place import START_DISTANCE_M, World
from wallride.sim.world.pose import Floats, Pose
from wallride.sim.world.segments import SegmentGeometry

MIN_REACH_M, MAX_REACH_M = 4.0, 8.0
"""Distance of a corner from the middle."""
SHARPEST_RAD = math.radians(125)
MIN_LENGTH_M = 3.0
BETWEEN_M = 0.3
"""Minimum distance between lanes that do not meet."""


def generated_track(seed: int, *, inner: bool = False) -> World:
    """Return the track of a seed; the same seed gives the same track on every machine."""
    for attempt in range(TRIES):
        random = np.random.default_rng([seed, attempt])
        corners = _corners(random)
        widths_m = random.uniform(MIN_WIDTH_M, MAX_WIDTH_M, len(corners))
        if _is_track(corners, widths_m):
            return _built(corners[::-1] if inner else corners, np.roll(widths_m[::-1], -1) if inner else widths_m)
    raise RuntimeError(f"seed {seed}: no track in {TRIES} tries")


def _corners(random: np.random.Generator) -> Floats:
    """Return the centre line's corners, (k, 2), clockwise."""
    count = int(random.integers(4, 9))
    angle = -math.tau * (np.arange(count) + random.uniform(-0.3, 0.3, count)) / count
    away_m = random.uniform(MIN_REACH_M, MAX_REACH_M, count)
    return np.column_stack([away_m * np.cos(angle), away_m * np.sin(angle)])


def _edges(corners: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the lengths of the lanes, their headings, and the turn at the end of each, left positive."""
    steps = np.roll(corners, -1, axis=0) - corners
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = (np.roll(heading, -1) - heading + math.pi) % math.tau - math.pi
    return np.hypot(steps[:, 0], steps[:, 1]), heading, turn


def _is_track(corners: Floats, widths_m: Floats) -> bool:
    """Return whether lanes are long enough, corners not too sharp, and no two lanes meet but at a corner."""
    length_m, _, turn = _edges(corners)
    if length_m.min() < MIN_LENGTH_M or np.abs(turn).max() > SHARPEST_RAD:
        return False
    count = len(corners)
    shares = np.linspace(0.0, 1.0, 40)[:, None]
    lanes = [corners[i] + shares * (corners[(i + 1) % count] - corners[i]) for i in range(count)]
    return all(
        np.hypot(*(lanes[i][:, None] - lanes[j][None]).transpose(2, 0, 1)).min()
        > (widths_m[i] + widths_m[j]) / 2 + BETWEEN_M
        for i, j in combinations(range(count), 2)
        if j - i not in {1, count - 1}
    )


def _built(corners: Floats, widths_m: Floats) -> World:
    plan = FloorPlan()
    length_m, heading, turn = _edges(corners)
    reach = np.minimum(np.tan(np.abs(turn) / 2), 1.0) / 2
    count = len(corners)
    for i in range(count):
        at = Pose(float(corners[i, 0]), float(corners[i, 1]), float(heading[i]))
        before_m = float(reach[i - 1] * widths_m[i - 1])
        beyond_m = float(reach[i] * widths_m[(i + 1) % count])
        plan.lane(at.ahead(-before_m), before_m + float(length_m[i]) + beyond_m, float(widths_m[i]))
    longest = int(length_m.argmax())
    distance_m = min(START_DISTANCE_M, float(widths_m[longest]) / 2)
    at = Pose(float(corners[longest, 0]), float(corners[longest, 1]), float(heading[longest]))
    start = at.ahead(float(length_m[longest]) / 2, float(widths_m[longest]) / 2 - distance_m)
    return World("", SegmentGeometry(plan.walls_m()), start, lap=Lap(corners), room_m=distance_m)
