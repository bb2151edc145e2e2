"""The six tests of MIT's wall-following lab, driven in the lab: the loss of `ball` beside that of the prototype.

Run: python -m benchmarks.mit_courses racecar_simulator/maps/building_31.yaml [--seeds 4] [--mu 0.8]

The map is that of mit-racecar/racecar_simulator; starts, ends, speeds and the loss are of mit-rss/wall_follower_sim. Of
each scan the loss takes the mean distance to the side of all returns between 0 and 1.5 m ahead of the lidar on the
wall's side, without noise, and counts how far that is from the wanted distance: a heading counts as well, and so does
what an opening shows. "Error" is the true one, from the rear axle. "On the path" is the loss of a car that stands
exactly on the ball's path at each place of the drive.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from wallride.runtime.map_files import read_settings
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.laws import drive_case
from wallride.sim.virtual.closed_loop import Case, SimulatedRun
from wallride.sim.world.ball_contour import places
from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.map_file import read_occupancy
from wallride.sim.world.place import World
from wallride.sim.world.pose import Floats, Pose, Side, side_sign

SOLID_ABOVE = 0.3
BEAMS_RAD = np.linspace(-2.355, 2.355, 100)
LIDAR_AHEAD_M, SEEN_TO_M = 0.275, 1.5
ENDS_WITHIN_M = 1.0
NEAR_THE_PATH_M = 0.5


@dataclass(frozen=True, slots=True)
class MitCourse:
    """One test: side, speed and distance wanted; start; place [m] near which it ends; time that is given."""

    side: Side
    speed_mps: float
    desired_m: float
    start: Pose
    end_m: complex
    within_s: float


COURSES = {
    "right, close": MitCourse("right", 1.0, 1.0, Pose(-4.0, -5.4, 0.0), 5.0 - 5.0j, 12.0),
    "left, far": MitCourse("left", 1.0, 1.0, Pose(5.0, -4.4, math.pi - 0.001), -4.0 - 5.0j, 12.0),
    "right, angled": MitCourse("right", 2.0, 1.0, Pose(-4.0, -5.0, -math.pi / 4), 5.0 - 5.0j, 8.0),
    "left, far and angled": MitCourse("left", 2.0, 1.0, Pose(5.0, -4.0, 3 * math.pi / 4), -4.0 - 5.0j, 8.0),
    "right, long": MitCourse("right", 2.0, 1.0, Pose(-4.0, -5.4, -math.pi / 6), -3.5 + 17.6j, 32.0),
    "left, long": MitCourse("left", 3.0, 0.72, Pose(-7.0, 10.6, 0.0), -4.0 - 5.0j, 32.0),
}


def drive(course: MitCourse, geometry: GridGeometry, law: str, seed: int, mu: float) -> SimulatedRun:
    """Drive a test; the run goes on behind the end."""
    world = World("building 31", geometry, course.start, course.side)
    case = Case(
        world, desired_m=course.desired_m, duration_s=course.within_s, standing_s=5.0,
        vehicle=VehicleSettings(grip_mu=mu), seed=seed,
    )  # fmt: skip
    return drive_case(Cell("", "", law, course.speed_mps, mu, course.side, seed, course.desired_m), case)


def until_the_end(run: SimulatedRun, course: MitCourse) -> int:
    """Return the number of scans up to the end of the test; all of a drive that does not come to it."""
    away_m = np.abs(run.pose[:, 0] + 1j * run.pose[:, 1] - course.end_m)
    there = np.flatnonzero(away_m < ENDS_WITHIN_M)
    return int(there[0]) if there.size else len(away_m)


def losses_m(world: World, poses: Floats, desired_m: float) -> Floats:
    """Return the loss at poses (n, 3) of the rear axle, shape (n,); NaN where nothing is seen beside the car."""
    found = np.full(len(poses), math.nan)
    for row, (x_m, y_m, yaw_rad) in enumerate(poses):
        lidar = Pose(x_m, y_m, yaw_rad).ahead(LIDAR_AHEAD_M)
        from_x_m, from_y_m = np.full(BEAMS_RAD.size, lidar.x_m), np.full(BEAMS_RAD.size, lidar.y_m)
        range_m = world.cast(from_x_m, from_y_m, yaw_rad + BEAMS_RAD)
        ahead_m, aside_m = range_m * np.cos(BEAMS_RAD), side_sign(world.side) * range_m * np.sin(BEAMS_RAD)
        beside = aside_m[np.isfinite(range_m) & (aside_m > 0.0) & (ahead_m > 0.0) & (ahead_m < SEEN_TO_M)]
        if beside.size:
            found[row] = abs(float(beside.mean()) - desired_m)
    return found


def on_the_path(geometry: GridGeometry, course: MitCourse, poses: Floats) -> Floats:
    """Return the poses of the ball's path that are nearest to poses (n, 3) and lead the same way, (k, 3)."""
    away_m = np.round(ndimage.distance_transform_edt(~geometry.solid) * geometry.cell_m, 6)
    rolled = places(away_m, geometry.cell_m, course.desired_m, course.side)
    centres = np.array([geometry.cell_centre(int(row), int(column)) for row, column in rolled.cell])
    found = []
    for x_m, y_m, yaw_rad in poses:
        off_m = np.hypot(centres[:, 0] - x_m, centres[:, 1] - y_m)
        same_way = rolled.heading @ np.array([math.cos(yaw_rad), math.sin(yaw_rad)]) > 0.5
        nearest = int(np.where(same_way, off_m, math.inf).argmin())
        if same_way[nearest] and off_m[nearest] < NEAR_THE_PATH_M:
            found.append((*centres[nearest], math.atan2(rolled.heading[nearest, 1], rolled.heading[nearest, 0])))
    return np.array(found).reshape(-1, 3)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line per test and law."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("map", type=Path, help="building_31.yaml")
    parser.add_argument("--seeds", type=int, default=4, help="how many")
    parser.add_argument("--mu", type=float, default=0.8)
    options = parser.parse_args(arguments)
    settings = read_settings(options.map)
    geometry = GridGeometry(read_occupancy(settings) > SOLID_ABOVE, settings.cell_m, Pose(*settings.origin))
    for name, course in COURSES.items():
        for law in ("ball", "prototype"):
            print(f"{name:22}{law:11}", _figures(course, geometry, law, options.seeds, options.mu), flush=True)
    return 0


def _figures(course: MitCourse, geometry: GridGeometry, law: str, seeds: int, mu: float) -> str:
    losses, errors_m, path_m, ended, touched = [], [], math.nan, 0, 0
    for seed in range(seeds):
        run = drive(course, geometry, law, seed, mu)
        count = until_the_end(run, course)
        poses, error_m = run.pose[:count], run.error_m[:count]
        ended += count < len(run.pose)
        touched += run.contact is not None and count == len(run.pose)
        losses.append(np.nanmean(losses_m(run.case.world, poses, course.desired_m)))
        errors_m.append(np.abs(error_m[np.isfinite(error_m)]).mean())
        if not seed:
            path = on_the_path(geometry, course, poses[::2])
            path_m = float(np.nanmean(losses_m(run.case.world, path, course.desired_m)))
    return (
        f"loss {np.mean(losses):.3f}  on the path {path_m:.3f}  error {np.mean(errors_m):.3f} m"
        f"  {ended} of {seeds} end, {touched} touch"
    )


if __name__ == "__main__":
    raise SystemExit(main())
