"""A Ray cluster behind `submit`: what is told without one. Its rows: tests/sim/lab/sweep/test_sweep_killed.py."""

import pytest

from sim.lab.workers import ray_cluster
from sim.lab.workers.finished_cell import WorkerStartError
from sim.lab.workers.submit import submit
from tests.sim.lab.workers.works import double


def test_without_ray_the_remedy_is_told(monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(ray_cluster, "import_module", missing)
    with pytest.raises(WorkerStartError, match=r"pip install 'wallride\[cluster\]'"):
        list(submit([1], double, on="ray"))
