"""How much too near the nearest of many noisy points is."""

from runtime.control.wall import CLEAN_INLIERS, Line


class NoiseBias:
    """b = d_line - d_nearest, slowly averaged [m]."""

    LOWEST_M, HIGHEST_M = -0.02, 0.12
    LOW_PASS = 0.1

    def __init__(self) -> None:
        self.bias_m = 0.0

    def learn(self, line: Line | None, nearest_m: float) -> float:
        """Take one scan and return the bias; held while the wall is no clean line."""
        if line is not None and line.inliers > CLEAN_INLIERS:
            found = line.distance_m - nearest_m
            if self.LOWEST_M < found < self.HIGHEST_M:
                self.bias_m += self.LOW_PASS * (found - self.bias_m)
        return self.bias_m
