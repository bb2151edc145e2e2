"""Trajectories as `evo` and other programs read them: TUM's text, a row for each pose."""

import math
from collections.abc import Iterable
from typing import Final

SUFFIX: Final = ".tum"


def tum_text(rows: Iterable[tuple[float, float, float, float]]) -> str:
    """Return `timestamp tx ty tz qx qy qz qw` of times [s], x and y [m] and yaw [rad], without what is not known."""
    lines = (
        f"{time_s:.6f} {x_m:.6f} {y_m:.6f} 0 0 0 {math.sin(yaw_rad / 2):.8f} {math.cos(yaw_rad / 2):.8f}"
        for time_s, x_m, y_m, yaw_rad in rows
        if math.isfinite(x_m + y_m + yaw_rad)
    )
    return "\n".join(["# timestamp tx ty tz qx qy qz qw", *lines, ""])
