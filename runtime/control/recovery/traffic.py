"""Memory of what moved near the car: while it may be behind, where the lidar is blind, the car does not back.

A lidar of 270 degrees leaves 90 degrees behind the car unseen. The memory of the way here (`rear_memory`) knows what
stands there, not what has come since. So a vehicle or person that moved and went out of sight counts as being behind
for some time; one that stopped in sight counts until it has stood for a moment, since it may move on.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from wallride.runtime.control.perception.obstacles.obstacle_track import ObstacleTrack

SETTLED_S = 3.0
"""Time that something has to stand, in sight, to count as an obstacle like any other."""
HIDDEN_S = 30.0
"""Time for which something that moved and went out of sight may be behind the car."""
OUT_OF_SIGHT_S = 0.15
"""Age of the last sight of a track that is no longer seen: some scans, at 10 to 40 a second."""
MOVED_M = 0.5
"""Minimum way that shows a vehicle or a person: table legs seem to move by less, for some scans in a bend."""
MOVED_S, FAST_MPS = 0.5, 0.5
"""Minimum time in motion that shows it to a car that is faster than this. In a bend among furniture what is seen of one
thing jumps to the next: as far, but for less than that."""
MAX_REMEMBERED = 30


@dataclass(slots=True)
class _Mover:
    """A track, the place at which it was first seen to move (odom), when it last was, and for how long in all.

    slowly: the car was slow meanwhile; what a fast and what a slow car sees are two pieces of evidence.
    """

    track: ObstacleTrack
    from_m: complex
    moved_s: float
    slowly: bool
    in_motion_s: float = 0.0
    goes: bool = False

    def move(self, now_s: float, before_s: float, *, slowly: bool) -> None:
        """Note that it moves by a scan of this time; before_s: of the scan before, from which on it was in motion."""
        if slowly != self.slowly:
            self.slowly, self.from_m, self.in_motion_s = slowly, self.track.place_m, 0.0
        elif self.moved_s == before_s:  # else it was out of sight or stood, and came up in between
            self.in_motion_s += now_s - before_s
        self.moved_s = now_s
        long_enough = slowly or self.in_motion_s >= MOVED_S
        self.goes |= long_enough and abs(self.track.place_m - self.from_m) > MOVED_M

    def until_s(self, now_s: float) -> float:
        """Return until when it counts."""
        hidden = self.goes and now_s - self.track.seen_s > OUT_OF_SIGHT_S
        return self.track.seen_s + HIDDEN_S if hidden else self.moved_s + SETTLED_S


class Traffic:
    """Remembers the tracks of what was seen to move, until it stands or has been out of sight for long enough."""

    def __init__(self) -> None:
        self._movers: dict[int, _Mover] = {}
        self._before_s = 0.0

    def update(self, moving: Iterable[ObstacleTrack], now_s: float, *, speed_mps: float, stood: bool) -> None:
        """Note what moves by this scan. moving: the tracks of that alone; now_s: the scan's time; speed_mps: the car's.

        stood: the car has stood for a while, so that the way before an object was seen to move counts as well.
        """
        slowly = abs(speed_mps) <= FAST_MPS
        for track in moving:
            mover = self._movers.get(id(track))
            if mover is None and len(self._movers) >= MAX_REMEMBERED:
                continue
            if mover is None:
                from_m = sum(track.before.edges_m) / 2 if stood else track.place_m
                mover = self._movers[id(track)] = _Mover(track, from_m, now_s, slowly)
            mover.move(now_s, self._before_s, slowly=slowly)
        self._before_s = now_s
        if self._movers:
            self._movers = {key: mover for key, mover in self._movers.items() if now_s < mover.until_s(now_s)}

    @property
    def is_about(self) -> bool:
        """Whether something may be behind the car that was not there when the car saw that place."""
        return any(mover.goes for mover in self._movers.values())
