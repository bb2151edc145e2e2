"""A Ray cluster behind `submit`: what is told without one. Its rows: tests/sim/lab/sweep/test_sweep_killed.py."""

import os
from types import SimpleNamespace

import pytest

from tests.sim.lab.workers.works import double
from wallride.sim.lab.workers import ray_cluster
from wallride.sim.lab.workers.finished_cell import WorkerStartError
from wallride.sim.lab.workers.submit import submit


def test_without_ray_the_remedy_is_told(monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(ray_cluster, "import_module", missing)
    with pytest.raises(WorkerStartError, match=r"pip install '\.\[cluster\]'"):
        list(submit([1], double, on="ray"))


@pytest.mark.parametrize(("on", "mode"), [("ray", "token"), ("192.168.0.20:6379", None)])
def test_a_cluster_on_this_machine_is_reached_from_it_alone_and_asks_for_a_token(on, mode, monkeypatch):
    said = {}
    monkeypatch.delenv("RAY_AUTH_MODE", raising=False)
    monkeypatch.setattr(ray_cluster, "import_module", lambda name: SimpleNamespace(init=said.update))
    ray_cluster._connected(on, 2)
    assert os.environ.get("RAY_AUTH_MODE") == mode
    assert said.get("_node_ip_address") == ("127.0.0.1" if on == "ray" else None)
    assert said["address"] == ("local" if on == "ray" else on)
