"""The simulator beside f1tenth_gym, in turns, on the same maps from the same starts.

Run: python benchmarks/simulator.py

Without --gym it is `wallride bench sim`. With it, steps per second of one core (CPU time) of both, the ratio, and what
both measure in a map that was drawn from known walls. How to get the peer, which is no part of the product:

    git clone https://github.com/f1tenth/f1tenth_gym gym
    python -m venv gymenv
    gymenv/bin/pip install "numpy<2" numba scipy pillow pyyaml "pyglet<1.5" gym==0.26.2 "setuptools<66"
    PYTHONPATH=gym/gym python benchmarks/simulator.py --gym gymenv/bin/python --maps ../shared/data/maps
"""

import argparse
import json
import os
import statistics
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from wallride.sim.bench import simulator
from wallride.sim.bench.medians import median_of
from wallride.sim.bench.simulator import CELL_M, drawn_loop, error_figures, loop_poses, turned
from wallride.sim.world.map_file import read_settings
from wallride.sim.world.worlds import load_world

PEER = Path(__file__).with_name("f1tenth_gym_steps.py")
POSES = 40


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
        ours.append(simulator.simulator(options.seconds, options.maps))
        if options.gym is not None:
            theirs.append(peer(options.gym, options.maps, options.seconds))
    medians, peers = median_of(ours), median_of(theirs) if theirs else None
    print("\n".join(simulator.lines(medians)))
    if peers is not None:
        print("\n".join(side_by_side(medians, peers)))
    if options.json:
        document = {"load": os.getloadavg(), "medians": medians, "gym": peers, "runs": ours, "gym_runs": theirs}
        Path(options.json).write_text(json.dumps(document, indent=2) + "\n")


def peer(interpreter: Path, maps: Path | None, seconds: float) -> dict[str, Any]:
    """Run the same in the gym; its answers as plain values."""
    with tempfile.TemporaryDirectory() as scratch:
        drawings = [_drawn(Path(scratch), name, turn_rad) for name, turn_rad in simulator.DRAWINGS.items()]
        request = {"seconds": seconds, "maps": [_on_map(path) for path in simulator.maps_in(maps)], "drawn": drawings}
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
