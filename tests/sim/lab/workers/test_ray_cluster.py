"""A Ray cluster behind `submit`: the same ends, also when a node goes."""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from sim.lab.workers import ray_cluster
from sim.lab.workers.finished_cell import WorkerStartError
from sim.lab.workers.submit import submit
from tests.sim.lab.workers.works import double

ROOT = Path(__file__).parents[4]


@pytest.mark.timeout(240)
@pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed: pip install 'wallride[cluster]'")
def test_two_nodes_of_which_one_is_killed_end_every_cell_once():
    done = subprocess.run(
        [sys.executable, "-m", "tests.sim.lab.workers.two_nodes"],
        cwd=ROOT, capture_output=True, text=True, check=True, timeout=220,
    )  # fmt: skip
    ended = json.loads(done.stdout.splitlines()[-1])
    assert sorted(cell for cell, _, _ in ended) == [-1, *range(60)]
    assert all(figures == {"twice": 2 * cell} for cell, figures, _ in ended if cell >= 0)
    (failed,) = (error for cell, _, error in ended if cell < 0)
    assert failed.startswith("ValueError: -1 is below zero (works.py:")


def test_without_ray_the_remedy_is_told(monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(ray_cluster, "import_module", missing)
    with pytest.raises(WorkerStartError, match=r"pip install 'wallride\[cluster\]'"):
        list(submit([1], double, on="ray"))
