"""Figures of the report: both errors over time, the way from above, and the distances through a sharp turn."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from wallride.sim.figures.drawing import save_plot
from wallride.sim.figures.summary import SETTLE_BAND_M
from wallride.sim.lab.courses.walls import world_of
from wallride.sim.lab.figures import Row
from wallride.sim.lab.report.drives import ABOUT, read_scenario
from wallride.sim.run_report.above import Above, from_above
from wallride.sim.run_report.charts import WIDTH, ChartLine, over_time
from wallride.sim.run_report.turn import turn_chart
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats, Pose

DOT_EVERY_M = 0.04
AROUND_M = 4.0
"""Maximum distance of a drawn wall from the paths."""
TALLEST_PX = 420


def trace(row: Row, name: str) -> Floats:
    """Return a column of a run's way; NaN where there is no value."""
    return np.array([np.nan if value is None else value for value in row["trace"][name]], dtype=np.float64)


def world_in(row: Row) -> World:
    """Return the world of a run, with the run's own start."""
    x_m, y_m, yaw_rad = (float(trace(row, name)[0]) for name in ("x_m", "y_m", "yaw_rad"))
    test, starts = read_scenario(row["scenario"].rpartition(" ")[0])
    return replace(world_of(starts.course(test).world, row["side"]), start=Pose(x_m, y_m, yaw_rad))


def follower_of(row: Row) -> str:
    """Return the name of a run's follower."""
    return str(row["law"]).partition("+")[0]


def error_chart(runs: Sequence[Row]) -> str:
    """Return the errors over time of one test, as SVG text; the first law is the report's."""
    lines = [
        ChartLine(f"{follower_of(row)}, {words}", trace(row, "time_s"), trace(row, name), style + faint)
        for row, style in zip(runs, ("s2", "s1"), strict=True)
        for name, words, faint in (("law_error_m", "its own", ""), ("true_error_m", "true", " faint"))
    ]
    return over_time(lines, "m", band=(-SETTLE_BAND_M, SETTLE_BAND_M))


def turn_chart_of(row: Row) -> str:
    """Return range ahead, nearest, distance to the line and turn radius of a run, as SVG text."""
    names = ("time_s", "ahead_m", "nearest_m", "line_m", "turn_radius_m")
    return turn_chart(*(trace(row, name) for name in names))


def path_view(row: Row, columns: int) -> str:
    """Return the path from above among the walls, as SVG text."""
    x_m, y_m = trace(row, "x_m"), trace(row, "y_m")
    dots = wall_dots(world_in(row))
    near = (np.abs(dots[:, 0] - np.clip(dots[:, 0], x_m.min(), x_m.max())) < AROUND_M) & (
        np.abs(dots[:, 1] - np.clip(dots[:, 1], y_m.min(), y_m.max())) < AROUND_M
    )
    dots = dots[near]
    return from_above(Above(dots[:, 0], dots[:, 1], x_m, y_m), WIDTH // columns, tallest=TALLEST_PX)


def wall_dots(world: World) -> Floats:
    """Return points (n, 2) on the walls of a world."""
    pieces = []
    for x0, y0, x1, y1 in world.outline_m.reshape(-1, 4):
        count = max(2, int(np.hypot(x1 - x0, y1 - y0) / DOT_EVERY_M))
        pieces.append(np.stack([np.linspace(x0, x1, count), np.linspace(y0, y1, count)], axis=1))
    return np.concatenate(pieces)


def save_figure(folder: Path, row: Row) -> str:
    """Write path and the law's own error of a run as a picture and return the file's name."""
    law = follower_of(row).replace(":", "-")
    test = str(row["test"])
    name = f"{test}-{law}.png"
    time_s, error_m = trace(row, "time_s"), trace(row, "law_error_m")
    track = np.stack([trace(row, "x_m"), trace(row, "y_m"), trace(row, "yaw_rad")], axis=1)
    title = f"{test}, {ABOUT[test]}: {law}, {row['speed_mps']:g} m/s, friction {row['mu']:g}"
    save_plot(folder / name, world_in(row), track, time_s, error_m, title)
    return name
