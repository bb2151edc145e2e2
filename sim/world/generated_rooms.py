"""Rooms generated from a seed: features of real buildings that no drawn course has, and no two alike.

A room is a way of lanes (1.2 to 3 m wide, corners of 60 to 150 degrees) that begins in a hall and leads to the feature
of its kind: furniture in the way, a wedge, a blind end, doors, corners, a loop of lanes. All are closed, so that a
drive of a minute stays inside: at the far end is another hall, or the car has to come back. `closed` is the control: a
cell in which no car of this size can turn or get anywhere.

The followed wall is on the left of the start; for the right-hand side mirror the world.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wallride.sim.world.floor_plan import FloorPlan
from wallride.sim.world.place import START_DISTANCE_M, World
from wallride.sim.world.pose import CAR, Pose
from wallride.sim.world.segments import SegmentGeometry, box

MIN_WIDTH_M, MAX_WIDTH_M = 1.2, 3.0
SHARPEST_DEG, BLUNTEST_DEG = 150.0, 60.0
HALL_M = 5.0
DOOR_M = 0.15
"""Thickness of a wall that a door is in."""
OVERLAP_M = 0.05
START_M = 1.5
"""Distance from the beginning of the first lane to the start of the car."""
FREE_START_M = 2.5
"""Minimum distance of furniture from the start."""
TRIES = 200

Random = np.random.Generator


@dataclass(slots=True)
class _Builder:
    """A room under construction: at is the pose at the end of the present lanes, width_m that of the last one."""

    random: Random
    plan: FloorPlan
    at: Pose
    width_m: float

    def width(self) -> float:
        return float(self.random.uniform(MIN_WIDTH_M, MAX_WIDTH_M))

    def lane(self, length_m: float, width_m: float | None = None, end_width_m: float | None = None) -> Pose:
        """Add a lane straight on and return where it began."""
        began = self.at
        self.width_m = width_m if width_m is not None else self.width_m
        self.at = self.plan.lane(self.at.ahead(-OVERLAP_M), length_m + OVERLAP_M, self.width_m, end_width_m)
        return began

    def corner(self, turn_deg: float, width_m: float) -> None:
        """Turn by an angle, left positive, into a lane of another width; the outer corner is as sharp as it comes."""
        turn_rad = math.radians(turn_deg)
        reach = min(math.tan(abs(turn_rad) / 2), 1.0) / 2
        self.plan.lane(self.at.ahead(-OVERLAP_M), OVERLAP_M + reach * width_m, self.width_m)
        turned = Pose(self.at.x_m, self.at.y_m, self.at.yaw_rad + turn_rad)
        self.plan.lane(turned.ahead(-reach * self.width_m), reach * self.width_m + OVERLAP_M, width_m)
        self.at, self.width_m = turned, width_m

    def door(self) -> None:
        """Continue through a door, anywhere in the end of the lane."""
        door_m = float(self.random.uniform(0.55, 1.2))
        aside_m = float(self.random.uniform(-1, 1)) * (self.width_m - door_m) / 2
        self.plan.lane(self.at.ahead(-OVERLAP_M, aside_m), DOOR_M + 2 * OVERLAP_M, door_m)
        self.at = self.at.ahead(DOOR_M, aside_m)
        self.width_m = self.width()
        self.at = self.at.ahead(0.0, float(self.random.uniform(-1, 1)) * max(0.0, self.width_m - door_m) / 2)

    def hall(self) -> None:
        """End in a hall in which a car can turn round."""
        self.lane(HALL_M, HALL_M)

    def furnish(self, began: Pose, length_m: float, count: int, widest_m: float = 0.7) -> None:
        """Place boxes and poles in the last lane: along its walls, or anywhere."""
        for _ in range(count):
            along_m, aside_m = self.random.uniform(0.3, length_m - 0.3), self.random.uniform(-0.5, 0.5) * self.width_m
            long_m, width_m = self.random.uniform(0.2, widest_m, 2)
            yaw_rad = began.yaw_rad + (self.random.uniform(0, math.pi) if self.random.random() < 0.5 else 0.0)
            at = began.ahead(float(along_m), float(aside_m))
            if math.hypot(at.x_m, at.y_m) > FREE_START_M:
                self.plan.things.append(box(at.x_m, at.y_m, float(long_m), float(width_m), yaw_rad))

    def perhaps_furnish(self, shortest_m: float, longest_m: float, share: float, widest_m: float) -> None:
        """Add a lane; in this share of the rooms two things stand in it."""
        length_m = float(self.random.uniform(shortest_m, longest_m))
        began = self.lane(length_m)
        if self.random.random() < share:
            self.furnish(began, length_m, 2, widest_m)

    def turn_deg(self) -> float:
        return float(self.random.uniform(BLUNTEST_DEG, SHARPEST_DEG) * self.random.choice([-1, 1]))


def _furniture(room: _Builder) -> None:
    """Build lanes with a box or pole every metre and a half, some of them in the way."""
    for _ in range(2):
        length_m = float(room.random.uniform(4.0, 7.0))
        began = room.lane(length_m, room.width())
        room.furnish(began, length_m, round(length_m / 1.5))
        room.corner(float(room.random.uniform(60, 100) * room.random.choice([-1, 1])), room.width())
        room.lane(1.0)
    room.hall()


def _wedge(room: _Builder) -> None:
    """Build a lane that narrows until the car cannot pass."""
    room.lane(float(room.random.uniform(2.0, 5.0)), room.width_m, float(room.random.uniform(0.05, 0.4)))


def _blind_end(room: _Builder) -> None:
    """Build a lane that ends, behind a corner or straight on, with or without an object in its end."""
    if room.random.random() < 0.5:
        room.corner(room.turn_deg(), room.width())
    room.perhaps_furnish(2.0, 5.0, 0.4, 0.5)


def _doors(room: _Builder) -> None:
    """Build three rooms in a row, with doors between them; some hold furniture."""
    for _ in range(2):
        room.door()
        room.perhaps_furnish(2.0, 4.0, 0.5, 0.6)
    room.door()
    room.hall()


def _corners(room: _Builder) -> None:
    """Build four corners of 60 to 150 degrees, with lanes of all widths between them."""
    for _ in range(4):
        room.corner(room.turn_deg(), room.width())
        room.lane(float(room.random.uniform(3.0, 6.0)))
    room.hall()


def _loop(room: _Builder) -> None:
    """Build lanes round a block, back into the first one; sometimes with an object in them, or with a blind lane."""
    turn = float(room.random.choice([-1, 1]))
    for _ in range(3):
        room.corner(90.0 * turn, room.width())
        room.perhaps_furnish(4.0, 6.0, 0.3, 0.6)
    room.corner(90.0 * turn, room.width())
    room.lane(float(room.random.uniform(3.0, 7.0)))


def _closed(room: _Builder) -> None:
    """Add nothing: see `_start`."""


KINDS: dict[str, Callable[[_Builder], None]] = {
    "furniture": _furniture,
    "wedge": _wedge,
    "blind end": _blind_end,
    "doors": _doors,
    "corners": _corners,
    "loop": _loop,
    "closed": _closed,
}
SHARES = ("furniture", "wedge", "blind end", "doors", "corners", "loop") * 3 + ("closed",)
"""Kinds of room by seed; one in 19 is the control."""


def kind_of(seed: int) -> str:
    """Return the kind of the room of a seed."""
    return SHARES[seed % len(SHARES)]


def generated_room(seed: int) -> World:
    """Return the room of a seed; the same seed gives the same room on every machine."""
    kind = kind_of(seed)
    for attempt in range(TRIES):
        random = np.random.default_rng([seed, attempt])
        world = _built(kind, random)
        if world.clearance(world.start) > 0.1:
            return world
    raise RuntimeError(f"seed {seed}: no room in which the car can start in {TRIES} tries")


def _built(kind: str, random: Random) -> World:
    width_m = float(random.uniform(MIN_WIDTH_M, MAX_WIDTH_M))
    room = _Builder(random, FloorPlan(), Pose(-START_M, 0.0, 0.0), width_m)
    if kind == "closed":
        width_m = room.width_m = float(random.uniform(0.52, 0.62))
        room.at = Pose(-CAR.front_m, 0.0, 0.0)
        room.lane(CAR.front_m + float(random.uniform(0.9, 1.3)))
    else:
        room.plan.lane(room.at.ahead(-HALL_M), HALL_M + OVERLAP_M, HALL_M)
        room.lane(START_M + float(random.uniform(3.0, 5.0)))
    KINDS[kind](room)
    distance_m = min(START_DISTANCE_M, width_m / 2)
    start = Pose(0.0, width_m / 2 - distance_m, 0.0)
    return World(kind, SegmentGeometry(room.plan.walls_m()), start, room_m=distance_m)
