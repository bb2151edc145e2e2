"""Every number of the lab report's evaluation: gains and errors, optima, trials, obstacles. Nothing here is ours.

The report (6.141 RSS, Lab 3, 5 March 2022): a car with L = 0.33 m and delta_max = 0.34 rad, 1 m to the wall wanted. It
does not give the speed, the start distances and angles, the kind of corner, the length of a run, nor the grid of its 25
trials.
"""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from wallride.sim.world.pose import Floats

Pair = tuple[float, float]
"""Kp [rad/m] and Kd [-]."""
Half = Literal["kd", "kp"]
"""Half of the gain tables, by the gain that is varied in it."""
TESTS = ("t1", "t2", "t3", "t4", "t5")
GAINS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5)
FIXED: Mapping[Half, float] = {"kd": 2.5, "kp": 1.0}
"""Value of the other gain in each half: Kp 2.5 while Kd varies, Kd 1 while Kp varies."""
ERRORS_M: Mapping[Half, Floats] = {
    "kd": np.array([
        (0.236, 0.263, 0.221, 0.330, 0.203),
        (0.225, 0.245, 0.134, 0.298, 0.211),
        (0.235, 0.157, 0.142, 0.307, 0.154),
        (0.195, 0.123, 0.154, 0.256, 0.142),
        (0.176, 0.120, 0.210, 0.336, 0.143),
        (0.198, 0.110, 0.269, 0.369, 0.160),
    ]),
    "kp": np.array([
        (0.446, 0.302, 0.359, 0.609, 0.090),
        (0.238, 0.133, 0.288, 0.400, 0.100),
        (0.202, 0.107, 0.193, 0.288, 0.141),
        (0.205, 0.100, 0.152, 0.256, 0.156),
        (0.195, 0.215, 0.205, 0.267, 0.161),
        (0.209, 0.183, 0.178, 0.241, 0.091),
    ]),
}  # fmt: skip
"""Average errors [m], a row per value of the varied gain, a column per test."""
OPTIMA: Mapping[str, Pair] = {"t1": (2.0, 2.0), "t2": (1.5, 2.5), "t3": (1.5, 0.5), "t4": (2.5, 1.5), "t5": (0.0, 1.5)}
FINAL: Pair = (1.5, 1.6)
"""Plain mean of the optima: the report's gains."""
TRIALS = TRIALS_PASSED = 25
OBSTACLE_SPEEDS_MPS = (1.0, 2.0, 3.0, 4.0)
OBSTACLE_DISTANCES_M = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)
NOT_STOPPED = ((0.3, 3.0), (0.3, 4.0))
"""Distance [m] and speed [m/s] of the two obstacles that were hit."""
STOPPED, OBSTACLES = 26, 28
EFFECTIVENESS, ERROR_RATIO = 0.929, 0.071
"""Shares of the obstacles that were not hit, and that were."""
STOP_BELOW_M, TURN_BELOW_M = 0.9329, 1.5


def repeatability_m(test: str) -> float:
    """Return the difference of the report's two errors of the pair that stands twice, Kp 2.5 and Kd 1 [m].

    One repetition: a smaller difference from the report means nothing.
    """
    column = TESTS.index(test)
    in_kd, in_kp = GAINS.index(FIXED["kp"]), GAINS.index(FIXED["kd"])
    return float(abs(ERRORS_M["kd"][in_kd, column] - ERRORS_M["kp"][in_kp, column]))


def as_document() -> dict[str, object]:
    """Return all of it as plain values, for `figures.json`."""
    return {
        "gains": list(GAINS), "fixed": dict(FIXED), "tests": list(TESTS),
        "errors_m": {half: table.tolist() for half, table in ERRORS_M.items()},
        "repeatability_m": {test: round(repeatability_m(test), 3) for test in TESTS},
        "optima": {test: list(pair) for test, pair in OPTIMA.items()}, "average": list(FINAL),
        "trials": TRIALS, "trials_passed": TRIALS_PASSED,
        "obstacle_speeds_mps": list(OBSTACLE_SPEEDS_MPS), "obstacle_distances_m": list(OBSTACLE_DISTANCES_M),
        "not_stopped": [list(one) for one in NOT_STOPPED], "stopped": STOPPED, "obstacles": OBSTACLES,
        "effectiveness": EFFECTIVENESS, "error_ratio": ERROR_RATIO,
        "stop_below_m": STOP_BELOW_M, "turn_below_m": TURN_BELOW_M,
    }  # fmt: skip
