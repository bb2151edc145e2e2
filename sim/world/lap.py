"""Progress round a closed course, measured along its centre line."""

from collections.abc import Sequence

import numpy as np

from wallride.sim.world.pose import Floats


class Lap:
    """A closed centre line in the direction of driving; the start line is at its first point.

    points_m: shape (n, 2); the last point is joined to the first.
    """

    def __init__(self, points_m: Floats | Sequence[tuple[float, float]]) -> None:
        self.points_m = np.array(points_m, dtype=np.float64).reshape(-1, 2)
        self._steps_m = np.roll(self.points_m, -1, axis=0) - self.points_m
        lengths_m = np.hypot(self._steps_m[:, 0], self._steps_m[:, 1])
        if len(self.points_m) < 3 or not lengths_m.all():
            raise ValueError("a lap needs at least three points, no two neighbours the same; the ring closes itself")
        self._lengths_m = lengths_m
        self._behind_m = np.concatenate([[0.0], np.cumsum(lengths_m)[:-1]])
        self.length_m = float(lengths_m.sum())

    def progress_m(self, x_m: float, y_m: float) -> float:
        """Return how far along the centre line its point nearest to x, y is, 0 <= progress < length."""
        dx, dy = x_m - self.points_m[:, 0], y_m - self.points_m[:, 1]
        share = np.clip((dx * self._steps_m[:, 0] + dy * self._steps_m[:, 1]) / self._lengths_m**2, 0.0, 1.0)
        away2 = (dx - share * self._steps_m[:, 0]) ** 2 + (dy - share * self._steps_m[:, 1]) ** 2
        nearest = int(np.argmin(away2))
        return float(self._behind_m[nearest] + share[nearest] * self._lengths_m[nearest]) % self.length_m

    def mirrored(self) -> "Lap":
        """Return the same course with y negated."""
        return Lap(self.points_m * [1, -1])


class LapCounter:
    """Accumulates progress over many laps, from the first update on. Backwards counts backwards."""

    def __init__(self, lap: Lap) -> None:
        self._lap = lap
        self._last_m: float | None = None
        self.driven_m = 0.0

    @property
    def laps(self) -> float:
        """Return the completed laps, with the fraction of the present one."""
        return self.driven_m / self._lap.length_m

    def update(self, x_m: float, y_m: float) -> float:
        """Update with the car's position, at least twice a lap, and return the completed laps."""
        here_m = self._lap.progress_m(x_m, y_m)
        if self._last_m is not None:
            half = self._lap.length_m / 2
            self.driven_m += (here_m - self._last_m + half) % self._lap.length_m - half
        self._last_m = here_m
        return self.laps
