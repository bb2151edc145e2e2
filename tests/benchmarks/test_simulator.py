"""The simulator's benchmark measures what it says, and a drawn map is seen where its walls are."""

import itertools
import json
import sys

import numpy as np
import pytest

from benchmarks import simulator
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.worlds import load_world


def test_a_map_is_seen_exactly_where_its_walls_are_drawn():
    along = simulator.exactness()["walls along the grid"]
    assert abs(along["bias_m"]) < 1e-9
    assert along["rms_m"] < 1e-9
    assert along["other_wall_share"] == 0.0


def test_stairs_lean_less_than_a_sixth_of_a_cell_to_one_side():
    aslant = simulator.exactness()["walls aslant"]
    assert abs(aslant["bias_m"]) < simulator.CELL_M / 6
    assert 0.0 < aslant["rms_m"] < simulator.CELL_M
    assert aslant["other_wall_share"] < 0.03


@pytest.mark.parametrize("noisy", [False, True])
def test_a_step_moves_the_car_on_and_looks_around(noisy):
    seen = list(itertools.islice(simulator.steps(load_world("loop"), LidarSettings(), noisy=noisy), 60))
    assert all(ranges.shape == (1081,) for ranges in seen)
    ahead = [float(np.median(ranges[530:551])) for ranges in seen]
    assert ahead[49] < ahead[0] - 0.3, "half a metre on in 50 steps"
    assert ahead[50] == pytest.approx(ahead[0], abs=0.1), "then from the start again"


def test_figures_of_a_folder_of_maps(tmp_path, capsys):
    figures = simulator.simulator(0.001, tmp_path)
    assert [row["name"] for row in figures["worlds"]] == ["loop", "curved", "cluttered", "a drawn loop"]
    assert all(row[kind] > 0 for row in figures["worlds"] for kind in row if kind != "name")
    assert len(simulator.lines(figures)) == 5 + len(figures["worlds"])


def test_the_command_prints_medians_and_writes_its_runs(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(simulator, "simulator", lambda _seconds, _maps: FIGURES)
    target = tmp_path / "sim.json"
    monkeypatch.setattr(sys, "argv", ["simulator", "--runs", "2", "--json", str(target)])
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    simulator.main()
    assert "numpy" in capsys.readouterr().out
    document = json.loads(target.read_text())
    assert len(document["runs"]) == 2
    assert document["medians"] == FIGURES


FIGURES = {
    "compiled": False,
    "worlds": [{"name": "loop", "steps_per_s": 1.0, "noisy_per_s": 1.0, "sweeping_per_s": 1.0, "numpy_per_s": 1.0}],
    "batch": {"one_by_one": 1.0, "together": 1.0},
    "exactness": {name: {"bias_m": 0.0, "rms_m": 0.0, "other_wall_share": 0.0} for name in simulator.DRAWINGS},
}
