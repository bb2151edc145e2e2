"""Race lines for tests: a circle, and the way round the block of `rooms.ring`."""

import math

import numpy as np

from wallride.runtime.control.line_following.race_line import CourseLine


def line_through(places, curvature_radpm, speed_mps):
    steps_m = np.abs(np.roll(places, -1) - places)
    along_m = np.concatenate([[0.0], np.cumsum(steps_m)[:-1]])
    yaw_rad = np.angle(np.roll(places, -1) - np.roll(places, 1))
    count = places.size
    return CourseLine(
        places, along_m, yaw_rad, np.full(count, 0.0) + curvature_radpm, np.full(count, 0.0) + speed_mps,
        float(steps_m.sum()),
    )  # fmt: skip


def circle(radius_m=3.0, speed_mps=2.0, step_m=0.1):
    """Round the origin to the left, from (radius, 0) on."""
    count = round(math.tau * radius_m / step_m)
    turn = np.exp(1j * math.tau * np.arange(count) / count)
    return line_through(radius_m * turn, 1.0 / radius_m, speed_mps)


def round_the_block(speed_mps=3.0, radius_m=1.0, step_m=0.1):
    """In the middle of the corridor of `rooms.ring`, anticlockwise, from (0, 0) on along x."""
    low, high = complex(0.0, 0.0), complex(10.0, 6.0)
    places, bends = [], []
    corners = [low, complex(high.real, low.imag), high, complex(low.real, high.imag)]
    for number, corner in enumerate(corners):
        ahead = 1j**number
        length_m = (high - low).real if number % 2 == 0 else (high - low).imag
        for way_m in np.arange(radius_m, length_m - radius_m, step_m):
            places.append(corner + way_m * ahead)
            bends.append(0.0)
        centre = corner + (length_m - radius_m) * ahead + radius_m * 1j * ahead
        for turn in np.arange(0.0, math.pi / 2, step_m / radius_m):
            places.append(centre + radius_m * ahead * -1j * np.exp(1j * turn))
            bends.append(1.0 / radius_m)
    return line_through(np.array(places), np.array(bends), speed_mps)
