"""Laps of one car from its odometry, as its status has it ten times a second. Pure: time is an argument.

Lap times are differences of the car's own clock, so that no link's delay is in them. To compare cars, the car's clock
is set against this computer's by the fastest message of the last half minute.
"""

import math
from collections import deque
from dataclasses import dataclass, replace
from statistics import median

HALF_WIDTH_M = 1.5
"""Half the width of a line through a pose: a track of a racing club is 2 to 3 m wide."""
FOLLOWS_YAW = 0.5
"""Share of the difference in heading that the line follows at each lap: odometry turns slowly, a car may pass askew."""
MIN_LAP_M = 3.0
"""Way after a crossing before the next one counts: a car that trembles on the line drives no laps."""
SETS_OFF_M = 0.1
"""Way after which a car that stood on its line has left it."""
LOST_S = 1.0
"""Silence after which the way in between is unknown."""
STOOD_M = 0.2
"""A car that is heard again this near to where it was has stood: a whole lap ends there once in a hundred times."""
JUMP_M = 1.0
MAX_MPS = 15.0
"""Speed above which it was not the car that moved, but its odometry that began anew."""
LEAST_SHARE = 0.5
"""Share of the usual lap time below which a crossing that was not seen is not believed."""
CLOCK_WINDOW_S = 30.0
MAX_HIDDEN = 1000
"""Laps that one silence may hide. A car with an odd clock would otherwise fill the memory with laps."""
MAX_LAPS = 20_000
"""Laps kept of one car: two days of laps of nine seconds."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """Passage over the line. share: of the step at which it happened, 0 to 1."""

    share: float
    forward: bool


@dataclass(frozen=True, slots=True)
class StartLine:
    """A line through a point x_m, y_m, crossed forward in the direction yaw_rad; odometry frame."""

    x_m: float
    y_m: float
    yaw_rad: float
    half_width_m: float = HALF_WIDTH_M

    def crossing(self, before_m: tuple[float, float], after_m: tuple[float, float]) -> Crossing | None:
        """Return how a straight step from one point (x, y) to another crosses the line; None when it does not."""
        from_m, to_m = self.ahead_m(*before_m), self.ahead_m(*after_m)
        if (from_m < 0.0) == (to_m < 0.0):
            return None
        share = from_m / (from_m - to_m)
        aside_m = (1 - share) * self._aside_m(*before_m) + share * self._aside_m(*after_m)
        return Crossing(share, forward=to_m > from_m) if abs(aside_m) <= self.half_width_m else None

    def ahead_m(self, x_m: float, y_m: float) -> float:
        """Return how far a point is beyond the line, in its direction."""
        return (x_m - self.x_m) * math.cos(self.yaw_rad) + (y_m - self.y_m) * math.sin(self.yaw_rad)

    def moved(self, x_m: float, y_m: float, yaw_rad: float) -> "StartLine":
        """Return the line after a car crossed it at this pose: the line drifts with the car's odometry."""
        turn_rad = math.remainder(yaw_rad - self.yaw_rad, math.tau)
        return replace(self, x_m=x_m, y_m=y_m, yaw_rad=self.yaw_rad + FOLLOWS_YAW * turn_rad)

    def _aside_m(self, x_m: float, y_m: float) -> float:
        return (y_m - self.y_m) * math.cos(self.yaw_rad) - (x_m - self.x_m) * math.sin(self.yaw_rad)


def line_between(left_m: tuple[float, float], right_m: tuple[float, float]) -> StartLine:
    """Return the line between two points (x, y), left and right of a car that crosses it; ValueError for one point."""
    (left_x_m, left_y_m), (right_x_m, right_y_m) = left_m, right_m
    width_m = math.hypot(right_x_m - left_x_m, right_y_m - left_y_m)
    if not (math.isfinite(width_m) and width_m > 0.0):
        raise ValueError("a start line needs two different points")
    yaw_rad = math.atan2(right_y_m - left_y_m, right_x_m - left_x_m) + math.pi / 2
    return StartLine((left_x_m + right_x_m) / 2, (left_y_m + right_y_m) / 2, yaw_rad, width_m / 2)


@dataclass(frozen=True, slots=True)
class RacePose:
    """A car's pose: session of its program, stamp_s on its own monotonic clock, pose in its odometry frame."""

    session: str
    stamp_s: float
    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class LapTime:
    """A lap. at_s: of its end, on this computer's clock. took_s: on the car's. seen: whether its end was observed."""

    at_s: float
    took_s: float
    seen: bool


class LapTimer:
    """Counts one car's laps.

    line: None makes the line where the car is first heard, across its heading. laps: all that are complete.
    began_s: when its first lap began, on this computer's clock, None before. heard_s: the newest sample's arrival.
    moved_s: when it last moved. restarts: how often its odometry began anew; the lap under way is then left out.
    """

    def __init__(self, line: StartLine | None = None) -> None:
        self._given = self._line = line
        self._last: RacePose | None = None
        self._clock = _CarClock()
        self._lap_from_s: float | None = None
        self._way_m = math.inf
        self._owed = 0
        self._unseen = False
        self.laps: list[LapTime] = []
        self.began_s: float | None = None
        self.heard_s = -math.inf
        self.moved_s = -math.inf
        self.restarts = 0

    def take(self, sample: RacePose, arrival_s: float) -> None:
        """Take a newer sample; one that another route brought before is left out."""
        last = self._last
        if last is not None and sample.session == last.session and sample.stamp_s <= last.stamp_s:
            return
        self.heard_s = arrival_s
        if last is None or self._is_another_frame(last, sample):
            self._begin(sample, arrival_s, again=last is not None)
            return
        self._clock.hear(sample.stamp_s, arrival_s)
        moved_m = math.hypot(sample.x_m - last.x_m, sample.y_m - last.y_m)
        self._way_m += moved_m
        if moved_m > 0.0:
            self.moved_s = arrival_s
        if sample.stamp_s - last.stamp_s > LOST_S and moved_m > STOOD_M:
            self._unseen = True
        self._last = sample
        self._advance(last, sample)

    def _is_another_frame(self, last: RacePose, sample: RacePose) -> bool:
        way_m = math.hypot(sample.x_m - last.x_m, sample.y_m - last.y_m)
        jumped = way_m > JUMP_M and way_m > MAX_MPS * (sample.stamp_s - last.stamp_s)
        return sample.session != last.session or jumped

    def _begin(self, sample: RacePose, arrival_s: float, *, again: bool) -> None:
        self.restarts += again
        self._last, self._clock = sample, _CarClock()
        self._clock.hear(sample.stamp_s, arrival_s)
        self._lap_from_s, self._way_m, self._owed, self._unseen = None, math.inf, 0, False
        self._line = self._given or StartLine(sample.x_m, sample.y_m, sample.yaw_rad)

    def _advance(self, last: RacePose, sample: RacePose) -> None:
        line = self._line
        if line is None:
            return
        if self._given is None and self._lap_from_s is None:
            if math.hypot(sample.x_m - line.x_m, sample.y_m - line.y_m) > SETS_OFF_M:
                self._start_lap(last.stamp_s)
            return
        crossing = line.crossing((last.x_m, last.y_m), (sample.x_m, sample.y_m))
        if crossing is not None:
            self._cross(crossing, last, sample, line)

    def _cross(self, crossing: Crossing, last: RacePose, sample: RacePose, line: StartLine) -> None:
        if not crossing.forward:
            self._owed += sample.stamp_s - last.stamp_s <= LOST_S  # a silence's straight step is not the car's way
            return
        if self._owed:  # it had gone back over the line
            self._owed -= 1
            return
        at_stamp_s = last.stamp_s + crossing.share * (sample.stamp_s - last.stamp_s)
        if self._way_m < MIN_LAP_M or not self._is_believed(at_stamp_s, sample.stamp_s - last.stamp_s):
            return
        if self._lap_from_s is not None:
            self._finish_laps(at_stamp_s, at_stamp_s - self._lap_from_s, sample.stamp_s - last.stamp_s)
        self._start_lap(at_stamp_s)
        self._line = line.moved(
            last.x_m + crossing.share * (sample.x_m - last.x_m),
            last.y_m + crossing.share * (sample.y_m - last.y_m),
            sample.yaw_rad,
        )

    def _is_believed(self, at_stamp_s: float, step_s: float) -> bool:
        """Tell whether a crossing counts: one within a silence is a straight line's, and perhaps not the car's."""
        usual_s = self._usual_s
        if step_s <= LOST_S or usual_s is None or self._lap_from_s is None:
            return True
        return at_stamp_s - self._lap_from_s > LEAST_SHARE * usual_s

    def _finish_laps(self, at_stamp_s: float, took_s: float, step_s: float) -> None:
        """Add the lap that ends here, and those before it whose ends a silence hid."""
        usual_s = self._usual_s
        share = took_s / usual_s if self._unseen and usual_s else 1.0
        count = min(max(1, round(min(share, MAX_HIDDEN))), MAX_LAPS - len(self.laps))
        seen = step_s <= LOST_S and not (self._unseen and usual_s is None)
        for k in range(count):
            end_s = at_stamp_s - took_s * (count - 1 - k) / count
            self.laps.append(LapTime(self._clock.here(end_s), took_s / count, seen and count == 1))

    def _start_lap(self, stamp_s: float) -> None:
        self._lap_from_s, self._way_m, self._unseen = stamp_s, 0.0, False
        if self.began_s is None:
            self.began_s = self._clock.here(stamp_s)

    @property
    def _usual_s(self) -> float | None:
        known_s = [lap.took_s for lap in self.laps if lap.seen]
        return median(known_s) if known_s else None


class _CarClock:
    """Difference between a car's clock and this computer's, by the message that was under way for the shortest time."""

    def __init__(self) -> None:
        self._least: deque[tuple[float, float]] = deque()

    def hear(self, stamp_s: float, arrival_s: float) -> None:
        offset_s = arrival_s - stamp_s
        while self._least and self._least[-1][1] >= offset_s:
            self._least.pop()
        self._least.append((arrival_s, offset_s))
        while arrival_s - self._least[0][0] > CLOCK_WINDOW_S:
            self._least.popleft()

    def here(self, stamp_s: float) -> float:
        return stamp_s + self._least[0][1]
