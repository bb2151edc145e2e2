"""The simulator: speed on one core and accuracy; beside f1tenth_gym in turns, on the same maps from the same starts.

Run: python -m benchmarks.simulator

A step equals a step of f1tenth_gym: 10 ms of motion, a contact check, and 1081 beams from the car's new place. Time is
the process's own CPU time, so that others on the machine count less. With --gym: steps per second of both, the ratio,
and what both measure in a map that was drawn from known walls. How to get the peer, which is no part of the product:

    git clone https://github.com/f1tenth/f1tenth_gym gym
    python -m venv gymenv
    gymenv/bin/pip install "numpy<2" numba scipy pillow pyyaml "pyglet<1.5" gym==0.26.2 "setuptools<66"
    PYTHONPATH=gym/gym python -m benchmarks.simulator --gym gymenv/bin/python --maps ../shared/data/maps
"""

import argparse
import json
import math
import os
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image

from wallride.runtime.map_files import read_settings
from wallride.sim.bench.measure import median_of
from wallride.sim.car.vehicle import SpeedDemand, Vehicle
from wallride.sim.world import compiled
from wallride.sim.world.beams import LidarSettings, scan, true_ranges_m
from wallride.sim.world.grid import GridGeometry
from wallride.sim.world.place import World
from wallride.sim.world.pose import CAR, Floats, Pose
from wallride.sim.world.segments import cast_walls
from wallride.sim.world.worlds import load_world

PEER = Path(__file__).with_name("f1tenth_gym_steps.py")
STEP_S: Final = 0.01
SPEED_MPS, STEERING_RAD = 1.0, 0.05
STEPS_PER_START = 50
"""Number of steps from the world's start before a restart: half a metre, free of contact on every map."""
LIDAR = LidarSettings(motion_skew=False)
SWEEPING = LidarSettings()
WALL_WORLDS = ("loop", "curved", "cluttered")
MADE_MAP = "a drawn loop"
NEARBY_MAPS = ("data/maps", "shared/data/maps")
CELL_M = 0.05
DRAWINGS: Final = {"walls along the grid": 0.0, "walls aslant": 0.3}
"""Angle by which the loop is turned, in rad, before it is drawn."""
POSES = 40
_SAME_WALL_M = 0.2


def main() -> None:
    """Parse, measure in turns, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--gym", type=Path, help="an interpreter that can import f110_gym")
    parser.add_argument("--maps", type=Path, help="folder of ROS maps (default: data/maps nearby)")
    parser.add_argument("--runs", type=int, default=3, help="turns, of which the median counts (default: 3)")
    parser.add_argument("--seconds", type=float, default=0.5, help="CPU time per figure (default: 0.5)")
    parser.add_argument("--json", help="write all runs and their medians as JSON")
    options = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    ours, theirs = [], []
    for _ in range(options.runs):
        ours.append(simulator(options.seconds, options.maps))
        if options.gym is not None:
            theirs.append(peer(options.gym, options.maps, options.seconds))
    medians, peers = median_of(ours), median_of(theirs) if theirs else None
    print("\n".join(lines(medians)))
    if peers is not None:
        print("\n".join(side_by_side(medians, peers)))
    if options.json:
        document = {"load": os.getloadavg(), "medians": medians, "gym": peers, "runs": ours, "gym_runs": theirs}
        Path(options.json).write_text(json.dumps(document, indent=2) + "\n")


def simulator(seconds: float = 0.5, maps: Path | None = None) -> dict[str, Any]:
    """Measure every world for `seconds` in each way; one run, as plain values."""
    sources = [*WALL_WORLDS, MADE_MAP, *map(str, maps_in(maps))]
    return {
        "compiled": compiled.by_c(cast_walls) is not None,
        "worlds": [_world_figures(source, seconds) for source in sources],
        "batch": _batch_figures(seconds),
        "exactness": exactness(),
    }


def lines(figures: Mapping[str, Any]) -> list[str]:
    """Return the figures (medians of runs) as a table for the terminal."""
    made = [f"{'steps per second of one core':<30}{'ranges':>12}{'with noise':>12}{'sweeping':>12}{'numpy only':>12}"]
    made += [
        f"{row['name']:<30}{row['steps_per_s']:12.0f}{row['noisy_per_s']:12.0f}{row['sweeping_per_s']:12.0f}"
        f"{row['numpy_per_s']:12.0f}"
        for row in figures["worlds"]
    ]
    batch, exact = figures["batch"], figures["exactness"]
    made.append(
        f"beams per second: {batch['one_by_one'] / 1e6:.1f} M one place at a time,"
        f" {batch['together'] / 1e6:.1f} M {POSES} places at a time"
    )
    made += [
        f"{name}: bias {1000 * exact[name]['bias_m']:+.3f} mm, rms {1000 * exact[name]['rms_m']:.3f} mm"
        for name in DRAWINGS
    ]
    made.append("compiled beams" if figures["compiled"] else "the kernel is not built: all of this is numpy")
    return made


def steps(world: World, lidar: LidarSettings, *, noisy: bool) -> Iterator[Floats]:
    """Drive on for ever; yield the lidar's ranges after each step."""
    vehicle, demand, rng = Vehicle(), SpeedDemand(SPEED_MPS), np.random.default_rng(0)
    room_m = world.clearance(world.start)
    while True:
        vehicle.place(world.start, speed_mps=SPEED_MPS)
        free_m = room_m
        for step in range(STEPS_PER_START):
            vehicle.step(STEP_S, demand, STEERING_RAD)
            pose, twist = vehicle.pose, vehicle.twist
            free_m -= (abs(twist.speed_mps) + abs(twist.yaw_rate_radps) * CAR.reach_m) * STEP_S
            if free_m <= 0.0:
                free_m = world.clearance(pose)
            if noisy:
                yield scan(world, pose, twist, step * STEP_S, rng, lidar) / 1000.0
            else:
                yield true_ranges_m(world, pose, twist, lidar)


def exactness() -> dict[str, dict[str, float]]:
    """Compare a drawn map with the walls that it was drawn from: bias and rms of all beams from many places.

    Walls along the grid are drawn without loss, so the rest is the cast's own error. Walls aslant become stairs;
    their error is the drawing's, and its mean shows a bias of the cast.
    """
    return {name: _errors(turned_rad) for name, turned_rad in DRAWINGS.items()}


def drawn_loop(turned_rad: float) -> GridGeometry:
    """Return the world "loop", turned about its middle, as a map whose cells are solid where their middles are."""
    half_m = 7.5
    middles = np.arange(-half_m, half_m, CELL_M) + CELL_M / 2
    x, y = np.meshgrid(middles, middles)
    cos, sin = math.cos(turned_rad), math.sin(turned_rad)
    along, across = np.abs(cos * x + sin * y), np.abs(cos * y - sin * x)
    free = (along < 6.0) & (across < 4.0) & ~((along < 4.0) & (across < 2.0))
    return GridGeometry(~free, CELL_M, Pose(-half_m, -half_m, 0.0))


def loop_poses(count: int) -> list[Pose]:
    """Return places in the loop's corridors, half a metre and more from every wall."""
    rng = np.random.default_rng(1)
    return [
        Pose(rng.uniform(-5.4, 5.4), rng.choice([-1.0, 1.0]) * rng.uniform(2.6, 3.4), rng.uniform(-3.1, 3.1))
        for _ in range(count)
    ]


def turned(pose: Pose, by_rad: float) -> Pose:
    """Return a pose turned about the world's origin."""
    at = Pose(0.0, 0.0, by_rad).ahead(pose.x_m, pose.y_m)
    return Pose(at.x_m, at.y_m, pose.yaw_rad + by_rad)


def _errors(turned_rad: float) -> dict[str, float]:
    walls, drawn = load_world("loop"), drawn_loop(turned_rad)
    fan_rad = np.radians(np.linspace(LIDAR.first_deg, LIDAR.last_deg, LIDAR.beams))
    errors = []
    for pose in loop_poses(POSES):
        at = turned(pose, turned_rad)
        seen_m = drawn.cast(at.x_m, at.y_m, fan_rad + at.yaw_rad)
        errors.append(seen_m - walls.cast(pose.x_m, pose.y_m, fan_rad + pose.yaw_rad))
    return error_figures(np.concatenate(errors))


def error_figures(errors_m: Floats) -> dict[str, float]:
    """Return bias and rms of the beams that met the same wall in both, and the share of the others."""
    same = errors_m[np.abs(errors_m) < _SAME_WALL_M]
    other = 1.0 - len(same) / len(errors_m)
    return {"bias_m": float(same.mean()), "rms_m": float(np.sqrt((same**2).mean())), "other_wall_share": other}


def maps_in(folder: Path | None) -> list[Path]:
    """Return the ROS maps of a folder, or of data/maps nearby; none when there is no such folder."""
    above = [Path.cwd(), *Path(__file__).resolve().parents]
    nearby = [folder] if folder is not None else [place / name for place in above for name in NEARBY_MAPS]
    found = next((place for place in nearby if place.is_dir()), None)
    return [] if found is None else sorted(found.glob("*.yaml"))


def _world(source: str) -> World:
    if source != MADE_MAP:
        return load_world(source)
    return replace(load_world("loop"), name=source, geometry=drawn_loop(0.0))


def _world_figures(source: str, seconds: float) -> dict[str, Any]:
    world = _world(source)
    with compiled.numpy_only():
        plain = _world(source)
    return {
        "name": Path(source).stem,
        "steps_per_s": _per_second(steps(world, LIDAR, noisy=False), seconds),
        "noisy_per_s": _per_second(steps(world, LIDAR, noisy=True), seconds),
        "sweeping_per_s": _per_second(steps(world, SWEEPING, noisy=False), seconds),
        "numpy_per_s": _per_second(steps(plain, LIDAR, noisy=False), seconds),
    }


def _batch_figures(seconds: float) -> dict[str, float]:
    """Return the beams per second in a drawn map, from one place per call and from many."""
    drawn = drawn_loop(0.3)
    poses = [turned(pose, 0.3) for pose in loop_poses(POSES)]
    fan_rad = np.radians(np.linspace(LIDAR.first_deg, LIDAR.last_deg, LIDAR.beams))
    bearings = [fan_rad + pose.yaw_rad for pose in poses]
    x_m, y_m = (np.repeat([getattr(pose, axis) for pose in poses], len(fan_rad)) for axis in ("x_m", "y_m"))
    all_rad = np.concatenate(bearings)

    def one_by_one() -> Iterator[None]:
        while True:
            for pose, bearing in zip(poses, bearings, strict=True):
                drawn.cast(pose.x_m, pose.y_m, bearing)
            yield

    def together() -> Iterator[None]:
        while True:
            drawn.cast(x_m, y_m, all_rad)
            yield

    return {
        "one_by_one": len(all_rad) * _per_second(one_by_one(), seconds),
        "together": len(all_rad) * _per_second(together(), seconds),
    }


def _per_second(work: Iterator[object], seconds: float) -> float:
    """Return the pieces of work per second of this process's CPU time; the first few do not count."""
    next(work)
    block = 1
    while True:
        began = time.process_time()
        for _ in range(block):
            next(work)
        took = time.process_time() - began
        if took >= seconds:
            return block / took
        block = max(2 * block, round(1.1 * block * seconds / max(took, 1e-3)))


def peer(interpreter: Path, maps: Path | None, seconds: float) -> dict[str, Any]:
    """Run the same in the gym; its answers as plain values."""
    with tempfile.TemporaryDirectory() as scratch:
        drawings = [_drawn(Path(scratch), name, turn_rad) for name, turn_rad in DRAWINGS.items()]
        request = {"seconds": seconds, "maps": [_on_map(path) for path in maps_in(maps)], "drawn": drawings}
        command = [str(interpreter), str(PEER)]
        done = subprocess.run(command, input=json.dumps(request), capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"f1tenth_gym did not run in {interpreter}; it said:\n{done.stderr}")
    answer: dict[str, Any] = json.loads(done.stdout)
    walls, angles = load_world("loop"), np.array(answer["angles"])
    exact = {}
    for name, scans in answer["drawn"].items():
        truth = [walls.cast(pose.x_m, pose.y_m, angles + pose.yaw_rad) for pose in loop_poses(POSES)]
        exact[name] = error_figures(np.concatenate(scans) - np.concatenate(truth))
    return {"maps": answer["maps"], "exactness": exact}


def side_by_side(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> list[str]:
    """Return the ratios: with noise and without, each against the same of the gym with its default RK4."""
    rows = {row["name"]: row for row in ours["worlds"]}
    lines = [f"{'f1tenth_gym':<20}{'RK4':>8}{'Euler':>8}{'no noise':>10}{'ratio, ranges':>16}{'with noise':>12}"]
    ratios = []
    for name, gym in theirs["maps"].items():
        ratio = rows[name]["steps_per_s"] / gym["rk4_without_noise"], rows[name]["noisy_per_s"] / gym["rk4"]
        ratios.append(ratio)
        figures = f"{gym['rk4']:8.0f}{gym['euler']:8.0f}{gym['rk4_without_noise']:10.0f}"
        lines.append(f"{name:<20}{figures}{ratio[0]:16.1f}{ratio[1]:12.1f}")
    if ratios:
        middle = [statistics.median(column) for column in zip(*ratios, strict=True)]
        lines.append(f"{'median':<46}{middle[0]:16.1f}{middle[1]:12.1f}")
    lines += [
        f"f1tenth_gym, {name}: bias {1000 * error['bias_m']:+.1f} mm, rms {1000 * error['rms_m']:.1f} mm"
        for name, error in theirs["exactness"].items()
    ]
    return lines


def _on_map(path: Path) -> dict[str, Any]:
    start, image = load_world(path).start, read_settings(path).image
    at = [start.x_m, start.y_m, start.yaw_rad]
    return {"name": path.stem, "yaml": str(path), "ending": image.suffix, "start": at}


def _drawn(folder: Path, name: str, turn_rad: float) -> dict[str, Any]:
    """Write the drawn loop as a ROS map; return its place, and the poses of the measurement."""
    grid = drawn_loop(turn_rad)
    inner, stem = grid.solid[1:-1, 1:-1], name.replace(" ", "_")
    Image.fromarray(np.where(inner, 0, 254).astype(np.uint8)[::-1]).save(folder / f"{stem}.png")
    corner = grid.origin.ahead(CELL_M, CELL_M)
    text = f"image: {stem}.png\nresolution: {CELL_M}\norigin: [{corner.x_m}, {corner.y_m}, 0.0]\nnegate: 0\n"
    path = folder / f"{stem}.yaml"
    path.write_text(f"{text}occupied_thresh: 0.65\nfree_thresh: 0.196\n")
    poses = [turned(pose, turn_rad) for pose in loop_poses(POSES)]
    places = [[pose.x_m, pose.y_m, pose.yaw_rad] for pose in poses]
    return {"name": name, "yaml": str(path), "ending": ".png", "start": places[0], "poses": places}


if __name__ == "__main__":
    main()
