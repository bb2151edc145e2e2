"""Bias of the nearest of many noisy points: b = d_line - d_nearest, slowly averaged [m].

The nearest point of a rough wall is nearer than its line as well, and truly so: what sticks out is part of the wall. So
b counts only as far as the sensor's noise explains it, which is measured by itself (`learn_noise_m`).
"""

import math

import numpy as np
import numpy.typing as npt

from wallride.drivers.accelerated import accelerated
from wallride.runtime.control.perception.geometry import Floats

Indices = npt.NDArray[np.intp]

MIN_BIAS_M, MAX_BIAS_M = -0.02, 0.12
LOW_PASS = 0.1
FIRST_NOISE_M = 0.01
NOISE_BEAMS = 40
"""Number of beams on each side of the nearest one that measure the noise: there the range hardly changes per beam."""
MIN_NOISE_BEAMS = 20
NOISE_STEP = 0.4
MIN_NOISE_M, MAX_NOISE_M = 1e-4, 0.1
BIAS_OF_NOISE = 3.6
"""The bias of the nearest of a smooth wall's points is this times noise^1.5 [1/sqrt(m)]: a tenth more than was found
for 0.5 to 1.5 m and 10 to 40 mm. The more noise, the more points beside the nearest place may be the nearest one."""
MAX_ROUGHNESS_M = 0.03


def learn_bias_m(bias_m: float, line_m: float, nearest_m: float) -> float:
    """Return the bias after one more scan. line_m: NaN while the wall is no clean line: then the bias is held."""
    found_m = line_m - nearest_m
    return bias_m + LOW_PASS * (found_m - bias_m) if MIN_BIAS_M < found_m < MAX_BIAS_M else bias_m


@accelerated
def learn_noise_m(noise_m: float, x_m: Floats, y_m: Floats, wall: Indices) -> float:
    """Return the median difference between the ranges of two neighbouring beams, after one more scan [m].

    wall: the beams that see it, (k,), of points (n,). A median, because a rough wall has steps at few beams only; it is
    followed by how many of this scan's differences are above it.
    """
    square = x_m[wall] ** 2 + y_m[wall] ** 2
    nearest = int(square.argmin())
    apart_m = np.abs(np.diff(np.sqrt(square[max(nearest - NOISE_BEAMS, 0) : nearest + NOISE_BEAMS + 1])))
    if apart_m.size < MIN_NOISE_BEAMS:
        return noise_m
    above = int(np.count_nonzero(apart_m > noise_m)) / apart_m.size  # a float of Python, as C returns
    return min(max(noise_m * (1.0 + NOISE_STEP * (above - 0.5)), MIN_NOISE_M), MAX_NOISE_M)


def roughness_m(bias_m: float, noise_m: float) -> float:
    """Return how far the nearest of a wall's parts stick out of its line: what noise does not explain of the bias."""
    return min(max(bias_m - BIAS_OF_NOISE * noise_m * math.sqrt(noise_m), 0.0), MAX_ROUGHNESS_M)
