"""Files of race lines: text with a row for each point, as the F1TENTH field writes and reads them.

Three lines of comment, then `s_m; x_m; y_m; yaw_rad; kappa_radpm; vx_mps; ax_mps2; away_m`: the first seven columns are
those of TUM's global_racetrajectory_optimization, but for the heading, which is REP-103's yaw (theirs counts from the y
axis).
"""

from typing import IO, Any, Final

import numpy as np

from wallride.runtime.line_files import AGAINST_LAP
from wallride.sim.racing.raceline import RaceLine

COLUMNS: Final = ("s_m", "x_m", "y_m", "yaw_rad", "kappa_radpm", "vx_mps", "ax_mps2", "away_m")


def text_of(line: RaceLine, about: str, map_print: str = "", *, is_against_lap: bool = False) -> str:
    """Return the content of a line's file. about: one sentence on where it is from. map_print: of the map's cells.

    is_against_lap: it goes round the other way than the lap of the map.
    """
    columns = (
        line.along_m, line.x_m, line.y_m, line.yaw_rad, line.curvature_radpm, line.speed_mps, line.acceleration_mps2,
        line.away_m,
    )  # fmt: skip
    of_map = (AGAINST_LAP if is_against_lap else "") + (f", map {map_print}" if map_print else "")
    head = [
        f"# {' '.join(about.split())}", f"# length {line.length_m:.3f} m, lap {line.lap_s:.3f} s, closed{of_map}"
    ]  # fmt: skip
    rows = ("; ".join(f"{value:.5f}" for value in row) for row in np.column_stack(columns).tolist())
    return "\n".join([*head, f"# {'; '.join(COLUMNS)}", *rows, ""])


def empty_picture() -> tuple[Any, Any]:
    """Return a figure of matplotlib, and its axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 8), layout="constrained")
    return figure, figure.subplots()


def save_picture(file: IO[bytes], outline_m: np.ndarray, line: RaceLine, title: str) -> None:
    """Write a picture of the line on its map, coloured by speed, as PNG.

    outline_m: segments x0, y0, x1, y1, shape (k, 4).
    """
    from matplotlib.collections import LineCollection

    figure, axes = empty_picture()
    axes.add_collection(LineCollection(list(outline_m.reshape(-1, 2, 2)), colors="0.35", linewidths=0.8))
    points = np.column_stack([line.x_m, line.y_m])
    pieces = np.stack([points, np.roll(points, -1, axis=0)], axis=1)
    drawn = axes.add_collection(LineCollection(list(pieces), array=line.speed_mps, cmap="viridis", linewidths=2.5))
    axes.plot(
        line.x_m[0], line.y_m[0], marker=(3, 0, np.degrees(line.yaw_rad[0]) - 90.0), color="tab:red", markersize=12
    )
    figure.colorbar(drawn, label="speed [m/s]")
    margin_m = 2.0
    axes.set_xlim(line.x_m.min() - margin_m, line.x_m.max() + margin_m)
    axes.set_ylim(line.y_m.min() - margin_m, line.y_m.max() + margin_m)
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    figure.savefig(file, dpi=120)
