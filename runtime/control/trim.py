"""A slow integral that learns how far off the middle the steering was mounted."""

from runtime.control.wall import Line

GAIN_PER_M2 = 0.4
MOST_RAD = 0.06
INLIERS = 45
ERROR_WITHIN_M = 0.1
BEARING_WITHIN_RAD = 0.15


class Trim:
    """I += 0.4 e ds, |I| <= 0.06 rad, only beside a straight wall and near the path, or it would learn corners.

    With kp 0.35, kd 1.5 the offset is learnt within 5 m of way (0.1 needs 22 m).
    """

    def __init__(self) -> None:
        self.steering_rad = 0.0

    def learn(self, line: Line | None, error_m: float, bearing_rad: float, moved_m: float) -> float:
        """Take one scan's error after `moved_m` of way and return the offset to add, wall on the left."""
        steady = line is not None and line.inliers > INLIERS
        if steady and abs(error_m) < ERROR_WITHIN_M and abs(bearing_rad) < BEARING_WITHIN_RAD:
            wanted = self.steering_rad + GAIN_PER_M2 * error_m * moved_m
            self.steering_rad = min(max(wanted, -MOST_RAD), MOST_RAD)
        return self.steering_rad


class NoiseBias:
    """How much too near the nearest of many noisy points is: b = d_line - d_nearest, slowly averaged [m]."""

    LOWEST_M, HIGHEST_M = -0.02, 0.12
    LOW_PASS = 0.1

    def __init__(self) -> None:
        self.bias_m = 0.0

    def learn(self, line: Line | None, nearest_m: float) -> float:
        """Take one scan and return the bias; held while the wall is no clean line."""
        if line is not None and line.inliers > INLIERS:
            found = line.distance_m - nearest_m
            if self.LOWEST_M < found < self.HIGHEST_M:
                self.bias_m += self.LOW_PASS * (found - self.bias_m)
        return self.bias_m
