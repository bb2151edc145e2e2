"""Counterpart of benchmarks/simulator.py for f1tenth_gym: runs in an interpreter of its own that can import f110_gym.

Reads a JSON request from standard input and writes the answer to standard output. Uses the gym's `Simulator` itself,
below the environment's own bookkeeping, which only helps it. Times are the process's CPU time.
"""

import json
import sys
import time
import warnings
from typing import Any

import numpy as np

warnings.filterwarnings("ignore")

from f110_gym.envs.base_classes import Integrator, RaceCar, Simulator  # noqa: E402 - after the warnings are off

CAR = {
    "mu": 1.0489, "C_Sf": 4.718, "C_Sr": 5.4562, "lf": 0.15875, "lr": 0.17145, "h": 0.074, "m": 3.74, "I": 0.04712,
    "s_min": -0.4189, "s_max": 0.4189, "sv_min": -3.2, "sv_max": 3.2, "v_switch": 7.319, "a_max": 9.51, "v_min": -5.0,
    "v_max": 20.0, "width": 0.31, "length": 0.58,
}  # fmt: skip
STEPS_PER_START = 50


def made(path: dict[str, Any], integrator: Any) -> Any:  # noqa: ANN401 - the gym has no types
    """Return a simulator with one car on a map. The car's class keeps one lidar for all; here each map has its own."""
    RaceCar.scan_simulator = None
    simulator = Simulator(CAR, 1, 12345, time_step=0.01, integrator=integrator)
    simulator.set_map(path["yaml"], path["ending"])
    return simulator


def steps_per_second(path: dict[str, Any], integrator: Any, seconds: float, *, noisy: bool) -> float:  # noqa: ANN401
    """Return the steps per second of CPU time, driving on from the start and starting again every 50 steps."""
    simulator, start, order = made(path, integrator), np.array([path["start"]]), np.array([[0.05, 1.0]])
    count, took, compiled = 0, 0.0, False
    while took < seconds:
        simulator.reset(start)
        if not noisy:
            simulator.agents[0].scan_rng = None
        began = time.process_time()
        for _ in range(STEPS_PER_START):
            simulator.step(order)
        if compiled:
            count += STEPS_PER_START
            took += time.process_time() - began
        compiled = True
    return count / took


def main() -> None:
    """Answer one request."""
    request = json.load(sys.stdin)
    answer = {"maps": {}, "drawn": {}}
    for path in request["maps"]:
        answer["maps"][path["name"]] = {
            "rk4": steps_per_second(path, Integrator.RK4, request["seconds"], noisy=True),
            "euler": steps_per_second(path, Integrator.Euler, request["seconds"], noisy=True),
            "rk4_without_noise": steps_per_second(path, Integrator.RK4, request["seconds"], noisy=False),
        }
    for path in request["drawn"]:
        lidar = made(path, Integrator.RK4).agents[0].scan_simulator
        answer["drawn"][path["name"]] = [lidar.scan(np.array(pose), None).tolist() for pose in path["poses"]]
        answer["angles"] = RaceCar.scan_angles.tolist()
    json.dump(answer, sys.stdout)


if __name__ == "__main__":
    main()
