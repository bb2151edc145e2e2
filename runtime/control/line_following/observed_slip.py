"""The slip of the rear axle by its stiffness alone, of the slip that a pose on the map tells.

Near its grip an axle slips more than its stiffness says (`tyres`). The pose knows one slip for all bends, to which each
adds by the square of the way that it moves the axle aside. So it is divided by the mean growth, weighed alike. The
slip told now and the mean one count, whichever is more: between two bends it is told too small. Until bends have told
enough, the assumption counts as well: the pose begins with a slip of its own.
"""

from typing import Final

from wallride.runtime.control.tyres import Moving, Tyres
from wallride.runtime.control.vehicle import GRAVITY_MPS2

ASSUMED: Final = 30.0
"""Weight of the assumed slip [m4/s5]: that of half a second in a bend, in the first lap at 3 m/s."""
REMEMBERED: Final = 3000.0
"""The same of what is remembered: some seconds in bends at 5 m/s."""


class ObservedSlip:
    """What is left of the observed slip without its growth."""

    def __init__(self) -> None:
        self._weight, self._growth, self._slip_s2pm = 0.0, 1.0, 0.0

    def take(self, car: Moving, since_s: float, assumed: Tyres, slip_s2pm: float) -> float:
        """Take in a scan; return the slip [s2/m] by the stiffness alone. A car that slides tells nothing."""
        lateral_mps2 = abs(car.speed_mps * car.turn_radps)
        weight = since_s * (car.speed_mps * lateral_mps2) ** 2
        if lateral_mps2 < assumed.mu * GRAVITY_MPS2 and weight > 0.0:
            self._weight = min(self._weight + weight, REMEMBERED)
            share = weight / self._weight
            self._growth += share * (assumed.slip_growth(lateral_mps2) - self._growth)
            self._slip_s2pm += share * (slip_s2pm - self._slip_s2pm)
        known = self._weight / (self._weight + ASSUMED)
        told_s2pm = max(self._slip_s2pm, slip_s2pm) / self._growth
        return assumed.slip_s2pm + known * (told_s2pm - assumed.slip_s2pm)
