"""The speed along a closed line: as fast as grip in bends, brake and motor allow."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from wallride.runtime.control.vehicle import GRAVITY_MPS2
from wallride.sim.world.pose import Floats

ROUNDS: Final = 2
"""The second begins with what the first has left at the seam."""
BRAKE_LIMIT_MPS2: Final = 4.6
"""A VESC ramps its set speed by 5.4 m/s2 at most: plans that brake harder enter bends too fast."""
DRIVE_SHARE: Final = 0.55
"""Share of the grip to drive with, unless braking may use more: with 0.8 a car spins where its line bends back."""


@dataclass(frozen=True, slots=True)
class Grip:
    """What a plan may use. mu: friction of the floor. lateral_share, brake_share: shares of mu g aside and in braking.

    The defaults leave what drives the line a reserve to correct with, and to brake with before what is not on the map.
    speed_mps is the highest speed, drive_mps2 the motor's largest acceleration.
    """

    mu: float = 0.8
    lateral_share: float = 0.75
    brake_share: float = 0.6
    speed_mps: float = 6.0
    drive_mps2: float = 4.0

    @property
    def lateral_mps2(self) -> float:
        """Return the largest lateral acceleration."""
        return self.lateral_share * self.mu * GRAVITY_MPS2

    @property
    def brake_mps2(self) -> float:
        """Return the largest deceleration."""
        return min(self.brake_share * self.mu * GRAVITY_MPS2, BRAKE_LIMIT_MPS2)

    @property
    def gain_mps2(self) -> float:
        """Return the largest acceleration along the way."""
        return min(self.drive_mps2, max(DRIVE_SHARE, self.brake_share) * self.mu * GRAVITY_MPS2)


def speeds_mps(curvature_radpm: Floats, steps_m: Floats, grip: Grip) -> Floats:
    """Return the speed at each point of a closed line, shape (n,).

    curvature_radpm: shape (n,). steps_m: shape (n,), way from each point to the next one. What a bend takes of the grip
    is not there to brake or drive with (friction ellipse).
    """
    bend = np.abs(curvature_radpm) / grip.lateral_mps2
    speed = np.minimum(grip.speed_mps, np.sqrt(1.0 / np.maximum(bend, 1e-9)))
    for _ in range(ROUNDS):
        speed = _pass(speed, bend, steps_m, grip.gain_mps2)
        speed = _pass(speed[::-1], bend[::-1], np.roll(steps_m[::-1], -1), grip.brake_mps2)[::-1]
    return speed


def lap_s(speed_mps: Floats, steps_m: Floats) -> float:
    """Return the time of a lap: each step at the mean of the speeds at its ends."""
    return float(np.sum(2.0 * steps_m / (speed_mps + np.roll(speed_mps, -1))))


def _pass(limit_mps: Floats, bend: Floats, steps_m: Floats, acceleration_mps2: float) -> Floats:
    """Return the speeds under `limit_mps` that rise by the acceleration at most, from the slowest point round."""
    begin, count = int(np.argmin(limit_mps)), len(limit_mps)
    speeds, curves, ways = limit_mps.tolist(), bend.tolist(), steps_m.tolist()
    for number in range(begin, begin + count):
        here, after = number % count, (number + 1) % count
        v2 = speeds[here] ** 2
        left = max(0.0, 1.0 - (v2 * curves[here]) ** 2) ** 0.5
        speeds[after] = min(speeds[after], (v2 + 2.0 * acceleration_mps2 * left * ways[here]) ** 0.5)
    return np.array(speeds)
