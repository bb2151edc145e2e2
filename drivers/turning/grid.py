"""From a turn to a scan with one angle step: every sample as it would be seen from where the car is now. Pure.

Rule: a sample belongs to the cell whose middle is nearest to its direction; a cell holds the nearest of its samples,
so that no obstacle is lost, and NaN where there is none. A cell is wider than the samples are apart, so that evenly
spaced ones leave none empty. The car's own motion during the turn is taken out first.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.drivers.turning.samples import Floats
from wallride.drivers.turning.turns import Turn
from wallride.drivers.value import value

COUNTS: Final = (1440, 1080, 900, 720, 600, 480, 360, 300, 240, 180)
"""Beams that a scan may have: 0.25 to 2 degrees each. Even numbers, so that one looks straight ahead."""
SPARE: Final = 1.1
"""Minimum number of samples per cell, for a head that turns a little faster than when the grid was chosen."""


@value()
class Motion:
    """Velocity of the lidar in its own mounting frame (x forward, y left) and rate of turn of the car."""

    x_mps: float = 0.0
    y_mps: float = 0.0
    yaw_rate_radps: float = 0.0


STILL: Final = Motion()
AskMotion = Callable[[], Motion]
"""Tells how the car moves now."""


def standing() -> Motion:
    """Return the motion of a car that does not move: where nothing tells it."""
    return STILL


def cells_for(samples_per_turn: float) -> int:
    """Return the number of beams of a scan; 0 where a turn has too few samples for any."""
    return next((count for count in COUNTS if count * SPARE <= samples_per_turn), 0)


@value()
class Mount:
    """How the sensor is mounted: direction of its zero, left of straight ahead, and whether it is upside down."""

    yaw_rad: float = 0.0
    upside_down: bool = False

    @property
    def cut_deg(self) -> float:
        """Return the direction straight behind the car, clockwise from the sensor's zero."""
        back_deg = math.degrees(math.pi - self.yaw_rad)
        return (back_deg if self.upside_down else -back_deg) % 360.0

    def bearing_rad(self, deg: Floats) -> Floats:
        """Return directions of the sensor (clockwise) as bearings of the car (counter-clockwise)."""
        turned: Floats = np.radians(deg if self.upside_down else -deg) + self.yaw_rad
        return turned


def resample(
    turn: Turn, motion: Motion, mount: Mount, count: int, range_min_m: float, range_max_m: float
) -> npt.NDArray[np.float32]:
    """Return the ranges of a full circle, shape (count,), from straight behind to the left: beam count / 2 is ahead.

    Float32 metres, read-only; NaN where no sample is between range_min_m and range_max_m.
    """
    usable = (turn.range_m >= range_min_m) & (turn.range_m <= range_max_m)  # NaN is not
    range_m, bearing_rad, ago_s = turn.range_m[usable], mount.bearing_rad(turn.deg[usable]), turn.ago_s[usable]
    if motion != STILL:
        range_m, bearing_rad = _seen_from_now(range_m, bearing_rad, ago_s, motion)
    step_rad = math.tau / count
    cell = np.rint((bearing_rad + math.pi) / step_rad).astype(np.intp) % count
    nearest_m = np.full(count, np.inf)
    np.minimum.at(nearest_m, cell, range_m)
    nearest_m[np.isinf(nearest_m)] = np.nan
    ranges_m = nearest_m.astype(np.float32)
    ranges_m.setflags(write=False)
    return ranges_m


def _seen_from_now(range_m: Floats, bearing_rad: Floats, ago_s: Floats, motion: Motion) -> tuple[Floats, Floats]:
    """Return ranges and bearings from the lidar's place at the turn's end, for a motion that was constant meanwhile."""
    turned_rad = -motion.yaw_rate_radps * ago_s
    places = range_m * np.exp(1j * (bearing_rad + turned_rad))
    places -= complex(motion.x_mps, motion.y_mps) * ago_s * np.exp(0.5j * turned_rad)
    return np.abs(places), np.angle(places)
