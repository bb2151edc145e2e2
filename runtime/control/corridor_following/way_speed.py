"""The speed along a way: grip in its bends, and the brake for them and for the end of sight."""

from typing import Final

from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import Floats
from wallride.runtime.control.vehicle import GRAVITY_MPS2

LATERAL_SHARE, BRAKE_SHARE = 0.6, 0.38
"""Of mu g: in bends less than the race line of a map counts on. The rest is for corrections, and a floor with less.
Safety brakes by 0.45: a way whose end comes in sight late is left a reserve, or safety brakes first."""
HIDDEN_PER_M: Final = 0.9
"""Curvature of the corner that begins where sight ends, as `ball` has it."""
SIGHT_SPARE_M: Final = 0.2


@value()
class WayGrip:
    """What a way may use. lateral_mps2, brake_mps2: accelerations. most_mps: the highest speed."""

    lateral_mps2: float
    brake_mps2: float
    most_mps: float

    @staticmethod
    def of(mu: float, most_mps: float) -> "WayGrip":
        """Return it for a floor."""
        return WayGrip(LATERAL_SHARE * mu * GRAVITY_MPS2, BRAKE_SHARE * mu * GRAVITY_MPS2, most_mps)


def way_speeds_mps(curvature_radpm: Floats, step_m: float, seen: int, grip: WayGrip) -> list[float]:
    """Return the speed at each point (n,) of a way. seen: how many points are seen, at least 1."""
    hidden2 = grip.lateral_mps2 / HIDDEN_PER_M
    seen = max(1, seen - round(SIGHT_SPARE_M / step_m))
    most2 = grip.most_mps * grip.most_mps
    bends = [abs(bend) / grip.lateral_mps2 for bend in curvature_radpm.tolist()]
    last2 = min(hidden2, most2)
    square = [last2] * len(bends)
    for number in range(seen - 1, -1, -1):
        bend = bends[number]
        used = min(1.0, last2 * bend)
        last2 = min(last2 + 2.0 * grip.brake_mps2 * step_m * (1.0 - used * used) ** 0.5, most2, 1.0 / max(bend, 1e-6))
        square[number] = last2
    return [value2**0.5 for value2 in square]
