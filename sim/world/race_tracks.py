"""Race tracks generated from a seed: closed, smooth, of one width. "track:seed=7", "track:seed=7,width=2.5,length=80".

The centre line goes clockwise round a middle, at a distance that is a sum of waves, so it never crosses itself; the
followed wall on the left is the outer one. `wallride.sim.world.generated_tracks` has tracks of lanes and corners
instead.
"""

import math
import re

import numpy as np

from wallride.sim.world.lap import Lap
from wallride.sim.world.place import START_DISTANCE_M, World
from wallride.sim.world.pose import Floats, Pose
from wallride.sim.world.segments import SegmentGeometry, chain

PREFIX = "track"
WIDTH_M, LENGTH_M = 2.2, 50.0
MIN_WIDTH_M, MAX_WIDTH_M = 1.2, 6.0
MIN_LENGTH_M, MAX_LENGTH_M = 25.0, 400.0
POINT_EVERY_M = 0.25
MIN_RADIUS_M = 1.2
"""Least radius of the centre line: the car's own is 0.93 m."""
MIN_INNER_RADIUS_M = 0.4
"""Least radius of the inner wall."""
BETWEEN_M = 0.3
"""Least distance between the walls of two parts of the track."""
WAVES = np.arange(2, 8)
TRIES = 500
_FINE = 2048
_WORD = re.compile(r"(seed|width|length)=(\d+(?:\.\d+)?)")


def is_track(name: str) -> bool:
    """Return whether a world's name is that of a track."""
    return name == PREFIX or name.startswith(f"{PREFIX}:")


def named_track(name: str, seed: int = 0) -> World:
    """Return the track of a name; ValueError says how to write one. seed: where the name has none."""
    words = [word for word in name.partition(":")[2].split(",") if word]
    read = [_WORD.fullmatch(word.strip()) for word in words]
    if not all(read) or (":" in name and not words):
        raise ValueError(f"world {name!r}: write track:seed=7, track:seed=7,width=2.5 or track:seed=7,length=80")
    values = {found.group(1): float(found.group(2)) for found in read if found}
    width_m, length_m = values.get("width", WIDTH_M), values.get("length", LENGTH_M)
    for what, value, low, high in (
        ("width", width_m, MIN_WIDTH_M, MAX_WIDTH_M), ("length", length_m, MIN_LENGTH_M, MAX_LENGTH_M),
    ):  # fmt: skip
        if not low <= value <= high:
            raise ValueError(f"world {name!r}: {what} must be {low:g} to {high:g} m")
    if values.get("seed", 0) % 1:
        raise ValueError(f"world {name!r}: a seed is a whole number")
    return race_track(int(values.get("seed", seed)), width_m, length_m)


def race_track(seed: int, width_m: float = WIDTH_M, length_m: float = LENGTH_M) -> World:
    """Return the track of a seed; the same seed gives the same track. ValueError where width and length leave none."""
    for attempt in range(TRIES):
        random = np.random.default_rng([seed, attempt])
        centre = _centre_line(random, length_m)
        if _is_wide(centre, width_m):
            return _built(seed, centre, width_m)
    raise ValueError(f"no track of {length_m:g} m is {width_m:g} m wide (seed {seed}); make it longer or narrower")


def _centre_line(random: np.random.Generator, length_m: float) -> Floats:
    """Return a closed line, (n, 2), clockwise, its points evenly POINT_EVERY_M apart."""
    size = random.uniform(0.0, 0.9, len(WAVES)) / WAVES
    phase = random.uniform(0.0, math.tau, len(WAVES))
    angle = -math.tau * np.arange(_FINE) / _FINE
    away = 1.0 + (size[:, None] * np.cos(WAVES[:, None] * angle + phase[:, None])).sum(axis=0)
    ring = np.column_stack([away * np.cos(angle), away * np.sin(angle)])
    closed = np.vstack([ring, ring[:1]])
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    count = round(length_m / POINT_EVERY_M)
    at = way[-1] * np.arange(count) / count
    even = np.column_stack([np.interp(at, way, closed[:, 0]), np.interp(at, way, closed[:, 1])])
    return np.asarray(even * (length_m / way[-1])) if away.min() > 0 else np.zeros((count, 2))


def _heading_and_turn(centre: Floats) -> tuple[Floats, Floats]:
    """Return the heading at each point, between its neighbours, and the turn there per metre, left positive."""
    step = np.roll(centre, -1, axis=0) - centre
    along = np.arctan2(step[:, 1], step[:, 0])
    turn = (along - np.roll(along, 1) + math.pi) % math.tau - math.pi
    return along - turn / 2, turn / POINT_EVERY_M


def _is_wide(centre: Floats, width_m: float) -> bool:
    """Return whether bends are wide enough for walls and car, and no two parts of the track touch."""
    _, turn = _heading_and_turn(centre)
    smoothed = (np.roll(turn, 1) + turn + np.roll(turn, -1)) / 3
    if np.abs(smoothed).max() * max(MIN_RADIUS_M, width_m / 2 + MIN_INNER_RADIUS_M) > 1.0:
        return False
    apart_m = width_m + BETWEEN_M
    some = centre[::2]
    count = len(some)
    index = np.arange(count)
    steps = np.abs(index[:, None] - index[None])
    along_m = np.minimum(steps, count - steps) * 2 * POINT_EVERY_M
    away_m = np.hypot(*(some[:, None] - some[None]).transpose(2, 0, 1))
    return bool((away_m > apart_m)[along_m > math.pi / 2 * apart_m].all())


def _built(seed: int, centre: Floats, width_m: float) -> World:
    heading, turn = _heading_and_turn(centre)
    straightness = np.abs(turn)
    bend = sum(np.roll(straightness, shift) for shift in range(-8, 9))  # 2 m before and after
    first = int(np.argmin(bend))
    centre, heading = np.roll(centre, -first, axis=0), np.roll(heading, -first)
    left = np.column_stack([-np.sin(heading), np.cos(heading)]) * (width_m / 2)
    walls = np.vstack([chain((centre + left).tolist(), closed=True), chain((centre - left).tolist(), closed=True)])
    distance_m = min(START_DISTANCE_M, width_m / 2)
    at = Pose(float(centre[0, 0]), float(centre[0, 1]), float(heading[0]))
    length_m = len(centre) * POINT_EVERY_M
    text = f"A smooth closed track from seed {seed}: {length_m:.0f} m long, {width_m:g} m wide; follows the outer wall."
    start = at.ahead(0.0, width_m / 2 - distance_m)
    return World(
        f"track:seed={seed}", SegmentGeometry(walls), start, lap=Lap(centre), description=text, room_m=distance_m
    )
