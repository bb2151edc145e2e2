"""After the lab report's law: PD on the nearest ranges and on the angle of a line through the points beside the car."""

import math

import numpy as np

from wallride.laws import CarSettings, Guidance, LawSettings, Scan, State


class PdSettings(LawSettings):
    """Settings; shown and changed as wall_follow.own.KEY."""

    kp: float = 1.5
    """Gain of the distance error [rad/m]."""
    kd: float = 1.6
    """Gain of the angle to the wall [-]."""
    corner_ahead_m: float = 2.0
    """Distance ahead below which half of it counts as the distance to the wall."""


class PdFollower:
    """Follows the wall on `state.side` at `state.desired_distance_m`."""

    Settings = PdSettings

    def __init__(self, settings: PdSettings, car: CarSettings) -> None:
        self.settings = settings
        self.car = car

    def follow(self, scan: Scan, state: State) -> Guidance:
        """Answer one scan."""
        sign = 1.0 if state.side == "left" else -1.0
        aside_rad = sign * scan.angles_rad
        used = scan.ranges_m > 0.2
        beside = (aside_rad >= 0.1 * math.pi) & (aside_rad <= 0.6 * math.pi) & used
        if np.count_nonzero(beside) < 3:
            return Guidance(0.0, 0.0, reason="no wall")
        x_m, y_m = scan.points_m()[:, beside]
        slope, _ = np.polyfit(x_m, sign * y_m, 1)
        distance_m = float(np.sort(scan.ranges_m[beside])[:3].mean())
        ahead = scan.ranges_m[(np.abs(scan.angles_rad) <= math.radians(0.5)) & used]
        ahead_m = float(np.sort(ahead)[:3].mean()) if ahead.size else math.inf
        corner = ahead_m <= self.settings.corner_ahead_m
        if corner:
            distance_m = ahead_m / 2
        steering_rad = 0.0  # on a line steeper than 60 degrees the car goes straight
        if abs(math.atan(slope)) <= math.pi / 3:
            error_m = distance_m - state.desired_distance_m
            steering_rad = self.settings.kd * math.atan(slope) + self.settings.kp * error_m
        reason = "corner ahead" if corner else "wall"
        return Guidance(state.desired_speed_mps, sign * steering_rad, distance_m, reason=reason)
