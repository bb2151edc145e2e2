"""Search of a way out over the poses of a car that drives forward and backward on its arcs.

Headings are whole steps of a full turn, and one step on the tightest arc turns the car by exactly one of them, so an
arc of the search is an arc of the car; the place is kept as it is, one pose for each cell (Dolgov et al. 2008, "hybrid
A*"; here all poses of one cost at once, which is Dijkstra's order and suits arrays). The search looks for the
cheapest way to a pose that is driven off: so far from here, facing away from here, with room ahead. It is made in
slices that take a millisecond or two each, for a car that stands and has time.
"""

import math
from collections import defaultdict
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wallride.runtime.control.perception.geometry import Booleans, Floats, Places
from wallride.runtime.control.perception.obstacles.rear_memory import on_track
from wallride.runtime.control.recovery.floor_map import CELL_M, CELLS, HALF_CELLS, Whole, border_of, outline_cells
from wallride.runtime.control.safety.footprint import Outline

MAX_STEP_M = 0.125
FORWARD_COSTS, BACKWARD_COSTS, CUSP_COSTS, STEERING_COSTS = 2, 3, 6, 1
"""Costs per step, per change of direction, per change of steering; half a step forward is 1."""
ROUND_COSTS = 10
"""Costs of a way that turns the car round by more than ROUND_RAD."""
ROUND_RAD = math.radians(100)
FACES_AWAY_COS = 0.3
TOWARD_RAD = 0.4
"""Largest angle from the bearing at which the car counts as turned to it."""
ROOM_AHEAD_STEPS = 5
MIN_GOAL_M = 1.2
SHORT_COSTS_PER_M, REPEATED_COSTS = 20.0, 25
"""Costs of an end that is nearer than wanted, and of one that an earlier try has led to in vain."""
REPEATED_WITHIN_M = 0.8
MAX_POSES = 60_000
POSES_AT_ONCE = 500
HEADINGS_AT_ONCE = 4
POSE_CELLS = 2
"""Side in cells of the square in which one pose is kept, for each heading and way."""
SPARE_M, TIGHT_SPARE_M = 0.02, -0.01
"""Clearance beside the margins of safety, half a cell; reduced for a car that has to leave the margins it stands in."""
NOSE_SPARE_M, TAIL_SPARE_M = 0.07, 0.03
"""Clearance at nose and tail: safety stops the car where it can still stop before its margins, not at them."""
STEERINGS = (1, 0, -1)
Move = tuple[int, int]
"""Way, +1 forward or -1 backward, and steering, +1 left to -1 right."""


@dataclass(frozen=True, slots=True)
class Leg:
    """A piece of a manoeuvre: a steering and a distance, negative backwards."""

    steering_rad: float
    travel_m: float


@dataclass(frozen=True, slots=True)
class Goal:
    """Goal of a way out: a distance from the present place, and places to avoid, base_link, (k,).

    toward_rad: bearing to turn to in place of these; NaN: any.
    """

    away_m: float
    earlier_m: Places
    toward_rad: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class WayOut:
    """Result of the search. legs: to drive in order, none without a way. end_m: the end of the way, base_link."""

    legs: tuple[Leg, ...]
    end_m: complex


NO_WAY = WayOut((), 0j)


class _Poses(NamedTuple):
    """Poses in the order of discovery; one array each, (n,)."""

    place_m: Places
    heading: Whole
    way: Whole
    """+1 forward, -1 backward, 0 at the start."""
    steering: Whole
    backed_m: Floats
    parent: Whole

    def some(self, which: Whole) -> "_Poses":
        """Return some of them."""
        return _Poses._make(each[which] for each in self)


def _joined(parts: list[_Poses]) -> _Poses:
    return parts[0] if len(parts) == 1 else _Poses._make(map(np.concatenate, zip(*parts, strict=True)))


class PoseSearch:
    """One search.

    outlines: the car's outline with and without what safety keeps clear. tightest: the steering's end and the
    wheelbase. backing: how far the car has backed already without coming forward again, and how far it may.
    track: where it stood not long ago, and its headings there, base_link: backing there does not count.
    refused: first moves, way and steering of STEERINGS, that safety did not let the car make from here.
    """

    def __init__(
        self,
        outlines: tuple[Outline, Outline],
        tightest: tuple[float, float],
        backing: tuple[float, float],
        track: tuple[Places, Places],
        goal: Goal,
        refused: frozenset[Move] = frozenset(),
    ) -> None:
        margins, bare = outlines
        self._refused = refused
        self._outlines = [
            (replace(one, front_m=margins.front_m + NOSE_SPARE_M), replace(one, rear_m=margins.rear_m + TAIL_SPARE_M))
            for one in (margins, bare)
        ]
        self._steering_rad, wheelbase_m = tightest
        curvature_per_m = math.tan(self._steering_rad) / wheelbase_m
        self._headings = math.ceil(math.tau / (curvature_per_m * MAX_STEP_M))
        turn_rad = math.tau / self._headings
        self._step_m = turn_rad / curvature_per_m
        self._backed_m, self._most_backed_m = backing
        self._track = track
        self._goal = goal
        turned = np.exp(1j * turn_rad * np.arange(self._headings))
        self._turned = turned
        chord_m = 2 * math.sin(turn_rad / 2) / curvature_per_m
        arcs_m = [chord_m * np.exp(0.5j * turn_rad), self._step_m + 0j, chord_m * np.exp(-0.5j * turn_rad)]
        # (way, steering, heading): the step from a pose. Backwards is the mirror image of forwards.
        ahead_m = np.array([[arc_m * one for one in turned] for arc_m in arcs_m])
        back_m = np.array([[-np.conj(arc_m) * one for one in turned] for arc_m in arcs_m])
        self._moves_m = np.stack([ahead_m, back_m])

    def look(self, blocked: Booleans) -> Generator[None, None, WayOut]:
        """Return the way out on a map of `floor_map`; yields after each slice."""
        border = border_of(blocked)
        free = np.empty((2, 2, self._headings, CELLS * CELLS), np.bool_)
        for first in range(0, self._headings, HEADINGS_AT_ONCE):
            for heading in range(first, min(first + HEADINGS_AT_ONCE, self._headings)):
                for pressed, back in ((0, 0), (0, 1), (1, 0), (1, 1)):
                    spare_m = TIGHT_SPARE_M if pressed else SPARE_M
                    outline = self._outlines[pressed][back]
                    free[pressed, back, heading] = self._free_at(border, heading, outline, spare_m)
            yield
        return (yield from self._spread(free.reshape(2, 2, -1)))

    def _free_at(self, border: Whole, heading: int, outline: Outline, spare_m: float) -> Booleans:
        """Return the cells in which the car may be at a heading, (CELLS * CELLS,)."""
        covered = outline_cells(outline, heading * math.tau / self._headings, spare_m)
        reach = int(np.abs(covered).max())
        wide = CELLS + 2 * reach
        taken = np.zeros(wide * wide, np.bool_)
        at = (border[:, 0] + reach) * wide + border[:, 1] + reach
        off = covered[:, 0] * wide + covered[:, 1]
        taken[(at[:, None] - off).ravel()] = True
        free: Booleans = ~taken.reshape(wide, wide)[reach:-reach, reach:-reach].ravel()
        return free

    def _spread(self, free: Booleans) -> Generator[None, None, WayOut]:
        """Expand the poses in the order of their costs."""
        waiting: dict[int, list[_Poses]] = defaultdict(list)
        zero = np.zeros(1, np.intp)
        waiting[0].append(_Poses(np.zeros(1, np.complex128), zero, zero, zero, np.array([self._backed_m]), zero - 1))
        seen = np.zeros(2 * free.shape[2], np.bool_)
        all_found: list[_Poses] = []
        count, cost = 0, 0
        best: tuple[float, int] = (math.inf, -1)
        while waiting and cost < best[0] and count < MAX_POSES:
            if cost not in waiting:
                cost += 1
                continue
            fresh = self._fresh(_joined(waiting.pop(cost)), seen)
            for first in range(0, fresh.heading.size, POSES_AT_ONCE):
                some = fresh.some(np.arange(first, min(first + POSES_AT_ONCE, fresh.heading.size)))
                all_found.append(some)
                best = min(best, self._driven_off(some, free[0, 0], cost, count))
                self._expand(some, count, cost, free, waiting)
                count += some.heading.size
                yield
            cost += 1
        return self._way(_joined(all_found), best[1]) if best[1] >= 0 else NO_WAY

    def _fresh(self, poses: _Poses, seen: Booleans) -> _Poses:
        """Return the poses in cells that were not reached before, one each, and mark these."""
        column = np.rint(poses.place_m.real / (POSE_CELLS * CELL_M)).astype(np.intp) + CELLS // 2
        row = np.rint(poses.place_m.imag / (POSE_CELLS * CELL_M)).astype(np.intp) + CELLS // 2
        key = (poses.heading * CELLS + row) * CELLS + column + (poses.way < 0) * (seen.size // 2)
        new = np.flatnonzero(~seen[key])
        _, first = np.unique(key[new], return_index=True)
        new = new[first]
        seen[key[new]] = True
        return poses.some(new)

    def _cell(self, poses: _Poses) -> Whole:
        column = np.rint(poses.place_m.real / CELL_M).astype(np.intp) + HALF_CELLS
        row = np.rint(poses.place_m.imag / CELL_M).astype(np.intp) + HALF_CELLS
        cell: Whole = (poses.heading * CELLS + row) * CELLS + column
        return cell

    def _expand(self, some: _Poses, count: int, cost: int, free: Booleans, waiting: dict[int, list[_Poses]]) -> None:
        parent = count + np.arange(some.heading.size)
        presses = (some.way == 0) | ~free[0, (some.way < 0).astype(np.intp), self._cell(some)]
        for back in (0, 1):
            way = -1 if back else 1
            backed_m = np.maximum(some.backed_m - way * self._step_m, 0.0)
            if back:
                known = on_track(some.place_m, self._turned[some.heading], *self._track)
                backed_m = np.where(known, some.backed_m, backed_m)
            for number, steering in enumerate(STEERINGS):
                if not count and (way, steering) in self._refused:
                    continue
                place_m = some.place_m + self._moves_m[back, number, some.heading]
                heading = (some.heading + way * steering) % self._headings
                full = np.full(heading.size, way), np.full(heading.size, steering)
                poses = _Poses(place_m, heading, *full, backed_m, parent)
                good = np.maximum(np.abs(place_m.real), np.abs(place_m.imag)) < (HALF_CELLS - 1) * CELL_M
                good &= (backed_m <= self._most_backed_m) | (not back)
                good = np.flatnonzero(good)
                poses = poses.some(good)
                cell = self._cell(poses)
                fits = free[0, back, cell] | (presses[good] & free[1, back, cell])
                turns = (some.way[good] == -way) * CUSP_COSTS + (some.steering[good] != steering) * STEERING_COSTS
                costs = cost + turns + (BACKWARD_COSTS if back else FORWARD_COSTS)
                for value in sorted(set(costs[fits].tolist())):
                    waiting[value].append(poses.some(np.flatnonzero(fits & (costs == value))))

    def _driven_off(self, some: _Poses, free: Booleans, cost: int, count: int) -> tuple[float, int]:
        """Return cost and number of the best of these poses at which the car is driven off, inf without one."""
        if not math.isnan(self._goal.toward_rad):
            return self._turned_to(some, free, cost, count)
        away_m = np.abs(some.place_m)
        facing = (some.place_m * self._turned[some.heading].conj()).real
        good = (some.way > 0) & (away_m >= MIN_GOAL_M) & (facing >= FACES_AWAY_COS * away_m)
        index = np.flatnonzero(good)
        index = index[self._room_ahead(some.some(index), free)]
        if not index.size:
            return math.inf, -1
        turned_rad = np.abs(np.angle(self._turned[some.heading[index]]))
        costs = cost + ROUND_COSTS * (turned_rad > ROUND_RAD)
        costs = costs + SHORT_COSTS_PER_M * np.maximum(self._goal.away_m - away_m[index], 0.0)
        repeated = np.abs(some.place_m[index, None] - self._goal.earlier_m) < REPEATED_WITHIN_M
        costs += REPEATED_COSTS * repeated.any(axis=1)
        least = int(costs.argmin())
        return float(costs[least]), count + int(index[least])

    def _turned_to(self, some: _Poses, free: Booleans, cost: int, count: int) -> tuple[float, int]:
        """Return cost and number of one of these poses at which the car faces the goal's bearing, inf without one."""
        off_rad = np.angle(self._turned[some.heading] * np.exp(-1j * self._goal.toward_rad))
        index = np.flatnonzero((some.way > 0) & (np.abs(off_rad) <= TOWARD_RAD))
        index = index[self._room_ahead(some.some(index), free)]
        return (float(cost), count + int(index[0])) if index.size else (math.inf, -1)

    def _room_ahead(self, some: _Poses, free: Booleans) -> Booleans:
        """Return at which poses the car can roll on for ROOM_AHEAD_STEPS, on one of its arcs."""
        room = np.zeros(some.heading.size, np.bool_)
        for number, steering in enumerate(STEERINGS):
            place_m, heading = some.place_m, some.heading
            clear = np.ones(some.heading.size, np.bool_)
            for _ in range(ROOM_AHEAD_STEPS):
                place_m = place_m + self._moves_m[0, number, heading]
                heading = (heading + steering) % self._headings
                inside = np.maximum(np.abs(place_m.real), np.abs(place_m.imag)) < (HALF_CELLS - 1) * CELL_M
                there = _Poses(np.where(inside, place_m, 0j), heading, heading, heading, some.backed_m, heading)
                clear &= ~inside | free[self._cell(there)]  # beyond the map the follower decides
            room |= clear
        return room

    def _way(self, poses: _Poses, number: int) -> WayOut:
        """Return the legs that lead to a pose: its steps, those of one kind joined."""
        end_m = complex(poses.place_m[number])
        steps: list[tuple[int, int]] = []
        while poses.parent[number] >= 0:
            steps.append((int(poses.way[number]), int(poses.steering[number])))
            number = int(poses.parent[number])
        legs: list[Leg] = []
        for way, steering in reversed(steps):
            steering_rad, travel_m = steering * self._steering_rad, way * self._step_m
            if legs and legs[-1].steering_rad == steering_rad and legs[-1].travel_m * way > 0:
                travel_m += legs.pop().travel_m
            legs.append(Leg(steering_rad, travel_m))
        return WayOut(tuple(legs), end_m)
