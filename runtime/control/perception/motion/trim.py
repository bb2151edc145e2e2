"""The steering's trim, learnt from the turn that the scans show: the change of heading from scan to scan.

It is compared with the steering as the turn follows it: on a course that goes one way round, a lag is no trim.
"""

import math
from typing import Final

from wallride.runtime.control.tyres import TURN_LAG_S, Moving, Tyres

LEAST_MPS: Final = 0.5
MOST_MPS2: Final = 1.5
"""Lateral acceleration above which the slip of the tyres would be taken for trim."""
STEADY_RAD: Final = 0.02
"""Largest distance of the told angle from that which the turn follows: beyond, the lag is not known well enough."""
LEARNS_S: Final = 1.5
MOST_RAD: Final = 0.08


class SteeringTrim:
    """rad: the true angle of the wheels that are told to be straight, left positive."""

    def __init__(self) -> None:
        self.rad = 0.0
        self._followed_rad = 0.0
        self._yaw_rad = math.nan

    def learn(self, now: Moving, told_rad: float, since_s: float, tyres: Tyres) -> None:
        """Take in a scan. told_rad: the angle that the motor reports."""
        followed_rad = self._followed_rad  # as it was half a scan before the middle of the turn
        self._followed_rad += (1.0 - math.exp(-since_s / TURN_LAG_S)) * (told_rad - followed_rad)
        steady = abs(told_rad - followed_rad) < STEADY_RAD
        turned_rad = math.remainder(now.yaw_rad - self._yaw_rad, math.tau) if since_s > 0.0 else math.nan
        self._yaw_rad = now.yaw_rad
        unfit = now.speed_mps < LEAST_MPS or abs(now.speed_mps * now.turn_radps) > MOST_MPS2
        if unfit or not steady or math.isnan(turned_rad):
            return
        wheels_rad = tyres.steering_rad(turned_rad / (since_s * now.speed_mps), now.speed_mps)
        gain = since_s / LEARNS_S
        trim_rad = self.rad + gain * (wheels_rad - followed_rad - self.rad)
        self.rad = math.copysign(min(abs(trim_rad), MOST_RAD), trim_rad)
