"""Pictures of a run: the path in its world with the error over time, and our steering beside a recorded one."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from wallride.runtime.host.output_files import write_file
from wallride.sim.figures.comparison import ComparedSteering
from wallride.sim.world.place import World
from wallride.sim.world.pose import CAR, Floats, Footprint, Pose

_DPI = 120
_MARGIN_M = 1.0
_MAX_WALL_M = 8.0
_OUTLINES = 12


def save_plot(path: Path, world: World, track: Floats, times_s: Floats, errors_m: Floats, title: str) -> None:
    """Write a picture of one run; the ending of the path decides the format.

    track: shape (n, 3) or wider, x [m], y [m], yaw [rad] of the rear axle. times_s, errors_m: shape (n,); errors are
    the wall's distance less the wanted one, inf or NaN where there was no wall. An empty run draws the world.
    """
    figure = Figure(figsize=(10, 8), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=[3, 1])
    _draw_world(above, world, track)
    above.set_title(title)
    _draw_errors(below, times_s, errors_m)
    _save(path, figure)


def save_comparison(path: Path, pairs: Sequence[ComparedSteering], title: str) -> None:
    """Write a picture of two steering angles over time: ours, and the recorded car's program's."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    axes = figure.subplots()
    times_s = [pair.time_s for pair in pairs]
    axes.step(times_s, [pair.recorded_rad for pair in pairs], where="post", color="0.6", label="recorded")
    axes.step(times_s, [pair.ours_rad for pair in pairs], where="post", color="tab:blue", label="ours")
    axes.axhline(0.0, color="0.8", linewidth=0.8, zorder=0)
    axes.set(xlabel="time [s]", ylabel="steering [rad], left positive", title=title)
    axes.legend(loc="upper right")
    _save(path, figure)


def _save(path: Path, figure: Figure) -> None:
    write_file(path, lambda file: figure.savefig(file, format=path.suffix.lstrip(".") or None, dpi=_DPI))


def _draw_world(axes: Axes, world: World, track: Floats) -> None:
    walls = world.outline_m
    axes.add_collection(LineCollection(list(walls.reshape(-1, 2, 2)), colors="0.25", linewidths=1.2))
    start = world.start
    seen = track[:, :2] if len(track) else np.array([[start.x_m, start.y_m]])
    if len(track):
        axes.plot(track[:, 0], track[:, 1], color="tab:blue", linewidth=1.5, zorder=3)
        for x_m, y_m, yaw_rad in track[np.unique(np.linspace(0, len(track) - 1, _OUTLINES).astype(int)), :3]:
            _draw_car(axes, Pose(x_m, y_m, yaw_rad), CAR)
    _draw_car(axes, start, CAR, color="tab:green")
    # Most of a building's map is far away: show the walls near the path, or all where the world is small.
    x_min, y_min, x_max, y_max = world.bounds_m
    low, high = seen.min(axis=0) - _MAX_WALL_M, seen.max(axis=0) + _MAX_WALL_M
    axes.set_xlim(max(x_min, float(low[0])) - _MARGIN_M, min(x_max, float(high[0])) + _MARGIN_M)
    axes.set_ylim(max(y_min, float(low[1])) - _MARGIN_M, min(y_max, float(high[1])) + _MARGIN_M)
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]")


def _draw_car(axes: Axes, pose: Pose, footprint: Footprint, color: str = "tab:orange") -> None:
    corners = [pose.ahead(forward, left) for forward, left in footprint.corners()]
    axes.fill(
        [at.x_m for at in corners],
        [at.y_m for at in corners],
        facecolor="none",
        edgecolor=color,
        linewidth=1.0,
        zorder=4,
    )


def _draw_errors(axes: Axes, times_s: Floats, errors_m: Floats) -> None:
    shown = np.where(np.isfinite(errors_m), errors_m, np.nan)
    axes.plot(times_s, shown, color="tab:red", linewidth=1.2)
    axes.axhline(0.0, color="0.6", linewidth=0.8, zorder=0)
    finite = shown[np.isfinite(shown)]
    if len(finite):
        axes.set_title(f"mean |error| {np.abs(finite).mean():.3f} m, worst {np.abs(finite).max():.3f} m", fontsize=10)
    axes.set(xlabel="time [s]", ylabel="distance - wanted [m]")
    axes.grid(visible=True, color="0.9")
