"""Whether the way from a car to its line is known to be free."""

from typing import Final

import numpy as np

from wallride.runtime.control.line_following.race_line import CourseLine, OnLine
from wallride.runtime.control.localization.line_field import LineField
from wallride.runtime.control.perception.geometry import Places

FLAT: Final = 2.0
"""Way along the line by its lateral distance: as flat as the law steers toward it."""
LEAST_M: Final = 1.0
STEP_M: Final = 0.1
CLEAR_M: Final = 0.3
"""Least distance of the car's middle from a wall on the way."""
KNOWN_SHARE: Final = 0.9
"""Least share of the way that the map knows to be free: single cells were seen by no beam."""


def way_is_free(field: LineField, line: CourseLine, place_m: complex, on: OnLine) -> bool:
    """Return whether the straight way from a place to its line leads through known free ground."""
    ahead_m = max(LEAST_M, FLAT * abs(on.aside_m))
    end_m = line.place_at(on.along_m + ahead_m)
    steps = 1 + int(abs(end_m - place_m) / STEP_M)
    way_m: Places = place_m + (end_m - place_m) * np.linspace(1.0 / steps, 1.0, steps).astype(np.complex128)
    cells = field.cells_at(way_m)
    lines = field.near.take(cells)
    normals = field.normals.take(lines)
    off_m = np.abs(normals.real * way_m.real + normals.imag * way_m.imag - field.offsets_m.take(lines))
    known = np.count_nonzero(field.free.take(cells)) >= KNOWN_SHARE * way_m.size
    return bool(known and off_m.min() >= CLEAR_M)
