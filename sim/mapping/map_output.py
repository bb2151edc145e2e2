"""The files of a map: `.yaml` and `.pgm` as ROS's map_server reads them, the lap's path, the walls, and a picture.

The path is text, `t_s; x_m; y_m; yaw_rad; speed_mps` of the rear axle in the map's frame, whose origin is where the
recording began, x ahead. `wallride line` finds it beside the map.
"""

import json
from pathlib import Path
from typing import IO, Final

import numpy as np

from wallride.runtime.host.output_files import Content
from wallride.runtime.map_files import WALLS_SUFFIX
from wallride.sim.mapping.closing import ClosedLap
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.mapping.odometry_path import of_the_axle
from wallride.sim.mapping.raster import CELL_M, Raster
from wallride.sim.racing.line_file import empty_picture
from wallride.sim.racing.ring import PATH_SUFFIX
from wallride.sim.world.pose import Floats

FREE, UNKNOWN, WALL = 254, 205, 0
"""Shades of map_saver."""
COLUMNS: Final = ("t_s", "x_m", "y_m", "yaw_rad", "speed_mps")


def path_of(record: LapRecord, lap: ClosedLap) -> Floats:
    """Return a row of COLUMNS for each keyframe, (n, 5); the speed as the map shows it."""
    times_s = np.array([frame.time_s for frame in lap.frames])
    axle = of_the_axle(lap.poses, record.lidar_m)
    ahead = np.gradient(axle[:, 0], times_s) * np.cos(axle[:, 2]) + np.gradient(axle[:, 1], times_s) * np.sin(
        axle[:, 2]
    )
    return np.column_stack([times_s - record.scan_s[0], axle, ahead])


def map_files(stem: Path, raster: Raster, path: Floats, walls: str, about: str, world: str = "") -> dict[Path, Content]:
    """Return the files of the grid, the path and the walls, with their contents.

    walls: as of `walls_text`. about: one sentence for all files. world: the simulated one.
    """
    endings = (".pgm", ".yaml", PATH_SUFFIX, WALLS_SUFFIX)
    image, yaml, way, lines = (stem.with_name(stem.name + ending) for ending in endings)
    shades = np.where(raster.wall, WALL, np.where(raster.free, FREE, UNKNOWN)).astype(np.uint8)[::-1]
    rows = ("; ".join(f"{value:.4f}" for value in row) for row in path.tolist())
    return {
        yaml: f"# {about}\nimage: {json.dumps(image.name, ensure_ascii=False)}\nresolution: {CELL_M}\n"
        f"origin: [{raster.corner_m[0]:.3f}, {raster.corner_m[1]:.3f}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n"
        + (f"# world: {world}\n" if world else ""),
        image: f"P5\n{shades.shape[1]} {shades.shape[0]}\n255\n".encode() + shades.tobytes(),
        way: "\n".join([f"# {about}", f"# {'; '.join(COLUMNS)}", *rows, ""]),
        lines: walls,
    }


def save_picture(file: IO[bytes], raster: Raster, path: Floats, lap: ClosedLap, title: str) -> None:
    """Write a picture of the map with the path, coloured by speed, and the edges that close the loop."""
    figure, axes = empty_picture()
    shades = np.where(raster.wall, 0.0, np.where(raster.free, 1.0, 0.75))
    x_m, y_m = raster.corner_m
    extent = (x_m, x_m + CELL_M * shades.shape[1], y_m, y_m + CELL_M * shades.shape[0])
    axes.imshow(shades, cmap="gray", vmin=0.0, vmax=1.0, origin="lower", extent=extent)
    for edge in lap.loops:
        ends = lap.poses[[edge.before, edge.after], :2]
        axes.plot(ends[:, 0], ends[:, 1], color="tab:red" if edge.full else "tab:orange", linewidth=0.6)
    drawn = axes.scatter(path[:, 1], path[:, 2], c=path[:, 4], s=6, cmap="viridis")
    axes.plot(path[0, 1], path[0, 2], marker=(3, 0, np.degrees(path[0, 3]) - 90.0), color="tab:red", markersize=12)
    figure.colorbar(drawn, label="speed [m/s]")
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    figure.savefig(file, dpi=120)
