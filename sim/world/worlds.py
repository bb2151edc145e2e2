"""Built-in worlds, by name, and the loader of any world.

Each builder puts the followed wall on the left of a car that starts at (0, 0), heading along x, with the wall at
y = 1 m (the loops: on their upper long side). For the right-hand side the world is mirrored.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from wallride.sim.world.lap import Lap
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats, Pose, Side
from wallride.sim.world.race_tracks import is_track, named_track
from wallride.sim.world.segments import SegmentGeometry, box, chain

_AT_ORIGIN = Pose(0.0, 0.0, 0.0)
_MAP_SUFFIXES = (".yaml", ".yml")


def load_world(name: str | Path, *, side: Side | None = None, seed: int = 0) -> World:
    """Return a built-in world by its name, a track by "track:seed=7", or a ROS map by the path of its .yaml file.

    side: on which side the followed wall shall be; default: left. Built-in worlds are mirrored for the right, in a
        map the start faces the other way.
    seed: seed of the places of the clutter in "cluttered", and of a "track" without one in its name.

    Raises:
        ValueError: no such built-in world (the message lists them), or a map file with invalid content.
        FileNotFoundError: the map does not exist.
    """
    if isinstance(name, Path) or is_map(name):
        from wallride.sim.world.map_file import load_map

        return load_map(Path(name), side=side or "left")
    if is_track(name):
        track = replace(named_track(name, seed), name=name)
        return track.mirrored() if side == "right" else track
    if name not in BUILDERS:
        known = ", ".join(BUILDERS)
        raise ValueError(
            f"no world is called {name!r}; choose one of {known}, track:seed=N, or give the path of a map's .yaml file"
        )
    builder = BUILDERS[name]
    world = cluttered(seed) if builder is cluttered else builder()
    world = replace(world, name=name, description=" ".join((builder.__doc__ or "").split()))
    return world.mirrored() if side == "right" else world


def is_map(name: str) -> bool:
    """Return whether a world's name is the path of a map."""
    return name.endswith(_MAP_SUFFIXES)


def is_there(name: str) -> bool:
    """Return whether a world's name names one: a built-in world, a track, or a map whose file is there."""
    return Path(name).is_file() if is_map(name) else is_track(name) or name in BUILDERS


def straight() -> World:
    """Two parallel walls 4 m apart and 60 m long, open at both ends; the far one is 3 m away at the start."""
    return _of([*chain([(-5, 1), (55, 1)]), *chain([(-5, -3), (55, -3)])])


def corridor() -> World:
    """A straight corridor 2 m wide and 60 m long, open at both ends."""
    return _of([*chain([(-5, 1), (55, 1)]), *chain([(-5, -1), (55, -1)])])


def loop() -> World:
    """A closed rectangular corridor, outer walls 12 x 8 m, 2 m wide; follows the outer wall. One lap is 30.3 m."""
    return _ring(chain(_RECTANGLE_OUTER, closed=True), chain(_RECTANGLE_INNER, closed=True))


def loop_inner() -> World:
    """The closed corridor of "loop", driven the other way round, so that the inner wall is the followed one."""
    return replace(loop().mirrored(), side="left")


def inside_corner() -> World:
    """A wall of 13 m, then a wall across the way 8 m ahead: the followed wall turns right by 90 degrees for 20 m."""
    return _of(chain([(-5, 1), (8, 1), (8, -19)]))


def outside_corner() -> World:
    """A wall that ends 6 m ahead and turns left by 90 degrees, away from the car, for 20 m."""
    return _of(chain([(-5, 1), (6, 1), (6, 21)]))


def doorway() -> World:
    """Two walls 4 m apart; the followed one, 0.1 m thick, has an open door 1 m wide 7 m ahead, a room behind it."""
    room = chain([(7, 1), (7, 1.1), (4, 1.1), (4, 4), (11, 4), (11, 1.1), (8, 1.1), (8, 1)])
    return _of([*chain([(-5, 1), (7, 1)]), *room, *chain([(8, 1), (35, 1)]), *chain([(-5, -3), (35, -3)])])


def l_turn() -> World:
    """A corridor 2 m wide that turns right by 90 degrees after 8 m: the followed wall is the outer one, for 20 m."""
    return _of([*chain([(-5, 1), (8, 1), (8, -19)]), *chain([(-5, -1), (6, -1), (6, -19)])])


def l_turn_inner() -> World:
    """A corridor 2 m wide that turns left by 90 degrees after 6 m: the followed wall is the inner one, for 20 m."""
    return _of([*chain([(-5, 1), (6, 1), (6, 21)]), *chain([(-5, -1), (8, -1), (8, 21)])])


def u_turn() -> World:
    """A corridor 2 m wide that turns right by 180 degrees round the end of a wall: the followed wall is the outer one.

    The end wall is 8 m ahead; the way back is 20 m long, beside the way there (the wall between is 0.1 m thick).
    """
    between = chain([(-12, -1), (6, -1), (6, -1.1), (-12, -1.1)])
    return _of([*chain([(-5, 1), (8, 1), (8, -3.1), (-12, -3.1)]), *between])


def u_turn_inner() -> World:
    """A corridor 2 m wide that turns left by 180 degrees round the end of the followed wall, 6 m ahead.

    The wall is 0.1 m thick, the way back 20 m long.
    """
    return _of([*chain([(-5, 1), (6, 1), (6, 1.1), (-14, 1.1)]), *chain([(-5, -1), (8, -1), (8, 3.1), (-14, 3.1)])])


def curved() -> World:
    """A corridor 2.5 m wide in an S: 5 m straight, left by 90 degrees, right by 120, left by 60, 10 m straight.

    The followed wall bends with radius 3 m (left bends) and 6 m (right bends); chords of 5 degrees.
    """
    centre = _path([(10.0, 0.0), (4.25, 90.0), (4.75, -120.0), (4.25, 60.0), (10.0, 0.0)], Pose(-5.0, -0.25, 0.0))
    return _of([*chain(_beside(centre, 1.25)), *chain(_beside(centre, -1.25))])


def dead_end() -> World:
    """A corridor 2 m wide that is closed 12 m ahead."""
    return _of(chain([(-5, 1), (12, 1), (12, -1), (-5, -1)]))


def cluttered(seed: int = 0) -> World:
    """A room of 16 x 10 m with 8 poles (2 to 5 cm thick in radius), 6 boxes and 2 gaps of 0.35 to 0.7 m between boxes.

    The start is 1 m from the upper wall and 2.5 m from the rear one, with 2 m free around it. The seed moves things.
    """
    random = np.random.default_rng(seed)
    walls = [*chain([(-2.5, 1), (13.5, 1), (13.5, -9), (-2.5, -9)], closed=True)]
    taken: list[tuple[float, float, float]] = [(0.5, 0.0, 1.5)]
    poles = [(*_free_spot(random, taken, 0.3), random.uniform(0.02, 0.05)) for _ in range(8)]
    for _ in range(6):
        length_m, width_m = random.uniform(0.3, 0.8, 2)
        walls += [*box(*_free_spot(random, taken, 0.8), length_m, width_m, random.uniform(0, np.pi))]
    for _ in range(2):
        middle, yaw_rad, gap_m = _free_spot(random, taken, 1.0), random.uniform(0, np.pi), random.uniform(0.35, 0.7)
        for way in (-1, 1):
            at = Pose(*middle, yaw_rad).ahead(way * (gap_m / 2 + 0.25))
            walls += [*box(at.x_m, at.y_m, 0.5, 0.4, yaw_rad)]
    return World("", SegmentGeometry(np.array(walls), np.array(poles)), _AT_ORIGIN)


BUILDERS: dict[str, Callable[[], World]] = {
    builder.__name__: builder
    for builder in (
        straight, corridor, loop, loop_inner, inside_corner, outside_corner, doorway, l_turn, l_turn_inner, u_turn,
        u_turn_inner, curved, cluttered, dead_end,
    )
}  # fmt: skip
"""Every built-in world by name."""

_RECTANGLE_OUTER: list[tuple[float, float]] = [(-6, -4), (6, -4), (6, 4), (-6, 4)]
_RECTANGLE_INNER: list[tuple[float, float]] = [(-4, -2), (4, -2), (4, 2), (-4, 2)]


def _of(walls_m: Floats | list[Floats]) -> World:
    return World("", SegmentGeometry(np.array(walls_m)), _AT_ORIGIN)


def _ring(outer: Floats, inner: Floats) -> World:
    """Return the loop, clockwise: start on the upper long side, centre line with bends of 1 m radius."""
    start = Pose(-3.0, 3.0, 0.0)
    middle = _path([(8.0, 0.0), (1.0, -90.0), (4.0, 0.0), (1.0, -90.0)] * 2, Pose(-4.0, 3.0, 0.0))
    centre = Lap(np.array([(at.x_m, at.y_m) for at in middle[:-1]]))
    return World("", SegmentGeometry(np.vstack([outer, inner])), start, lap=_along(centre, start))


def _along(lap: Lap, start: Pose) -> Lap:
    """Return the same ring with its first point, the start line, at the start pose, which lies on it."""
    ring = lap.points_m
    steps = np.roll(ring, -1, axis=0) - ring
    to_start = np.array([start.x_m, start.y_m]) - ring
    ahead = np.sum(steps * to_start, axis=1) / np.sum(steps**2, axis=1)
    aside = np.abs(steps[:, 0] * to_start[:, 1] - steps[:, 1] * to_start[:, 0])
    (edge,) = np.flatnonzero((ahead > 0) & (ahead < 1) & (aside < 1e-9))
    return Lap(np.vstack([[start.x_m, start.y_m], np.roll(ring, -edge - 1, axis=0)]))


def _path(pieces: list[tuple[float, float]], at: Pose) -> list[Pose]:
    """Return the poses along a path of pieces: (length, 0) goes straight, (radius, degrees) turns, left positive."""
    poses = [at]
    for size_m, turn_deg in pieces:
        if turn_deg == 0.0:
            poses.append(poses[-1].ahead(size_m))
            continue
        steps = max(1, round(abs(turn_deg) / 5.0))
        turn_rad = np.radians(turn_deg) / steps
        for _ in range(steps):
            last, chord_m = poses[-1], 2 * size_m * abs(np.sin(turn_rad / 2))
            end = Pose(last.x_m, last.y_m, last.yaw_rad + turn_rad / 2).ahead(chord_m)
            poses.append(Pose(end.x_m, end.y_m, last.yaw_rad + turn_rad))
    return poses


def _beside(path: list[Pose], left_m: float) -> list[tuple[float, float]]:
    return [((at := pose.ahead(0.0, left_m)).x_m, at.y_m) for pose in path]


def _free_spot(
    random: np.random.Generator, taken: list[tuple[float, float, float]], room_m: float
) -> tuple[float, float]:
    """Take and return a place in the cluttered room whose circle of `room_m` overlaps no circle that is taken."""
    for _ in range(1000):
        x, y = float(random.uniform(-2.0 + room_m, 13.0 - room_m)), float(random.uniform(-8.5 + room_m, 0.5 - room_m))
        if all(np.hypot(x - ox, y - oy) > room_m + radius for ox, oy, radius in taken):
            taken.append((x, y, room_m))
            return x, y
    raise RuntimeError("the cluttered room is full; ask for fewer things or less room around them")
