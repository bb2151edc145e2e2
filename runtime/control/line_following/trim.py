"""The steering's trim, learnt from the turn that the scans show."""

import math
from typing import Final

from wallride.runtime.control.line_following.line_law import Moving
from wallride.runtime.control.line_following.tyres import Tyres

LEAST_MPS: Final = 0.5
MOST_MPS2: Final = 1.5
"""Lateral acceleration above which the slip of the tyres would be taken for trim."""
STEADY_RAD: Final = 0.02
"""Largest change of the told angle from scan to scan: the turn follows a faster one with a lag."""
LEARNS_S: Final = 1.5
MOST_RAD: Final = 0.08


class SteeringTrim:
    """rad: the true angle of the wheels that are told to be straight, left positive."""

    def __init__(self) -> None:
        self.rad = 0.0
        self._told_rad = 0.0

    def learn(self, now: Moving, told_rad: float, since_s: float, tyres: Tyres) -> None:
        """Take in a scan. told_rad: the angle that the motor reports."""
        change_rad, self._told_rad = abs(told_rad - self._told_rad), told_rad
        lateral_mps2 = now.speed_mps * now.turn_radps
        if now.speed_mps < LEAST_MPS or abs(lateral_mps2) > MOST_MPS2 or change_rad > STEADY_RAD:
            return
        wheels_rad = tyres.steering_rad(now.turn_radps / now.speed_mps, now.speed_mps)
        gain = since_s / LEARNS_S
        trim_rad = self.rad + gain * (wheels_rad - told_rad - self.rad)
        self.rad = math.copysign(min(abs(trim_rad), MOST_RAD), trim_rad)
