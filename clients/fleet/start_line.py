"""The line at which laps are counted, in a car's own odometry frame. Pure."""

import math
from dataclasses import dataclass, replace

HALF_WIDTH_M = 1.5
"""Half the width of a line through a pose: a track of a racing club is 2 to 3 m wide."""
FOLLOWS_YAW = 0.5
"""Share of the difference in heading that the line follows at each lap: odometry turns slowly, a car may pass askew."""


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
